"""Capsules and hulls that cover meshes: they contain every point, have few corners, and are cached."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.kernels import gjk as kernel
from sidegan.robot import Setup, load_robot
from sidegan.robot.arm import digest_of
from sidegan.robot.covering import cover, cut
from sidegan.robot.fitting import fit_capsule, from_segment, simplify_hull, volume
from sidegan.validity import Constraints

from .arms import shape_accuracy
from .judge import Facts, Judge
from .urdf import INERTIA, joint, link, mesh, one_joint, robot

seeds = st.integers(0, 10**6)


def triangles(seed: int, count: int) -> np.ndarray:
    """Random triangles [m], (N, 3, 3), small ones and large ones, some of them degenerate."""
    random = np.random.default_rng(seed)
    size = 10.0 ** random.uniform(-3, -0.5, (count, 1, 1))
    made = random.uniform(-0.4, 0.4, (count, 1, 3)) + size * random.normal(size=(count, 3, 3))
    made[:: max(2, count // 2), 1] = made[:: max(2, count // 2), 0]
    return made * random.uniform(0.05, 1.0, 3)


def box(x: float, y: float, z: float, place=(0, 0, 0)) -> np.ndarray:
    return np.array(trimesh.creation.box((x, y, z)).triangles) + place


def on_sphere(count: int, seed: int = 0) -> np.ndarray:
    """Random points (N, 3) on a sphere of 0.1 m."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points * 0.1 / np.linalg.norm(points, axis=1, keepdims=True)


def from_hull(points: np.ndarray, hull: np.ndarray) -> np.ndarray:
    """Distance [m], (N,), of points (N, 3) from a hull; 0 inside."""
    both, starts = np.concatenate([hull, np.zeros((1, 3))]), np.array([0, len(hull), len(hull) + 1])
    hulls = kernel.Hulls(both, starts, np.zeros(2), np.zeros(2), np.array([True]))
    turn, middle, room = tuple(map(tuple, np.eye(3))), hull.mean(0) + 1e-9, np.zeros((6, 4))
    found = [kernel.apart(hulls, (0, 1), turn, tuple(x), tuple(middle - x), np.inf, room) for x in points]
    return np.maximum(found, 0.0)


@settings(max_examples=8)
@given(seeds, st.integers(1, 40), st.integers(1, 4), st.integers(1, 5), st.integers(0, 3))
def test_every_point_of_a_mesh_is_covered(seed, count, pieces, meshes, hollow):
    whole = triangles(seed, count)
    made = cover(np.array_split(whole, min(meshes, count)), pieces, hollow)
    most = pieces + (meshes - 1 if min(meshes, count) <= pieces else 0)
    assert 1 <= len(made) <= max(most, (0, 16, 48, 48)[hollow])
    shares = np.random.default_rng(seed).dirichlet([1, 1, 1], len(whole))
    points = np.concatenate([whole.reshape(-1, 3), np.einsum("nk,nki->ni", shares, whole)])
    outside = [
        np.maximum(from_segment(ends, points) - radius, from_hull(points, hull) - rounding)
        for (ends, radius), hull, rounding in made
    ]
    assert np.min(outside, axis=0).max() <= 1e-8


def finely(shape: trimesh.Trimesh, times: int) -> np.ndarray:
    """Triangles of a shape, each divided into four this many times."""
    for _ in range(times):
        shape = shape.subdivide()
    return np.array(shape.triangles)


def torus() -> np.ndarray:
    return np.array(trimesh.creation.torus(0.1, 0.03, major_sections=100, minor_sections=100).triangles)


def fork() -> np.ndarray:
    tine, bridge = trimesh.creation.box((0.02, 0.04, 0.2)), trimesh.creation.box((0.12, 0.04, 0.02))
    tines = [finely(tine, 5) + np.array([x, 0, 0.1]) for x in (-0.05, 0.05)]
    return np.concatenate([*tines, np.array(bridge.triangles)])


@pytest.mark.parametrize("made", [torus, fork])
def test_meshes_of_many_triangles_are_opened_by_cuts_found_on_few(made):
    seen = []
    cut([made()], 4, 0.0, lambda part: seen.append(len(part)) or 0.0)
    assert sorted(seen)[-2] <= 1000 and max(seen) == len(made()) >= 20_000  # once as a whole
    parts = cover([made()], 4, 1)
    points = made().reshape(-1, 3)[::370]
    outside = [from_hull(points, part.corners) - part.rounding for part in parts]
    assert np.min(outside, axis=0).max() <= 1e-8
    free = np.array([[0.0, 0.0, 0.0]]) if made is torus else np.array([[0.0, 0.0, z] for z in (0.05, 0.15)])
    assert min(from_hull(free, part.corners).min() - part.rounding for part in parts) > 0.01


INTERRUPTED = """
import signal, tests.robot.test_covering as made
signal.signal(signal.SIGTERM, signal.default_int_handler)
print("begun", flush=True)
made.cover([made.torus()] * 4, 4, 2)
print("finished")
"""


def test_a_signal_ends_fitting_before_it_has_finished():
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout.readline() == "begun\n"
    process.terminate()
    assert process.communicate()[0] == "" and process.returncode != 0


def test_a_capsule_around_a_tilted_rod_is_nearly_the_smallest():
    random = np.random.default_rng(0)
    axis = np.array([1.0, 2.0, 2.0]) / 3
    points = random.uniform(-0.5, 0.5, (300, 1)) * axis
    beside = np.cross(axis, random.normal(size=(300, 3)))
    points = points + 0.05 * beside / np.linalg.norm(beside, axis=1, keepdims=True)
    capsule = fit_capsule(points)
    assert from_segment(capsule[0], points).max() <= capsule[1]
    assert volume(capsule) <= 1.02 * np.pi * 0.05**2 * (4 / 3 * 0.05 + 1.0)


def test_an_l_shape_is_split_at_its_bend_and_a_plate_in_half():
    """One capsule around two rods that meet at a right angle is a fat ball, two are nearly the rods."""
    rods = np.concatenate([box(0.5, 0.02, 0.02, (0.25, 0, 0)), box(0.02, 0.5, 0.02, (0, 0.25, 0))])
    one, two = cover([rods], 1), cover([rods], 2)
    assert len(two) == 2
    assert sum(volume(part.capsule) for part in two) < 0.1 * volume(one[0].capsule)
    (one,), two = (cover([box(0.6, 0.3, 0.02)], most) for most in (1, 2))
    assert sum(volume(part.capsule) for part in two) < 0.8 * volume(one.capsule)


def test_a_few_meshes_of_a_link_are_covered_one_by_one():
    """A column with a shoulder and a head: planes that save more volume would close the gap between these."""
    meshes = [box(0.4, 0.3, 0.5), *(box(0.1, 0.1, 0.1, (0.25, 0, z)) for z in (-0.2, 0.2))]
    in_the_gap = np.array([[0.27, 0.0, z] for z in (-0.1, 0.0, 0.1)])
    parts = cover(meshes, 3)
    assert 3 <= len(parts) <= 5
    assert min(from_hull(in_the_gap, part.corners).min() for part in parts) > 0.01
    assert len(cover(meshes, 2)) <= 2


@settings(max_examples=20)
@given(seeds, st.integers(5, 400), st.sampled_from([1e-5, 1e-3, 1e-2]))
def test_a_thinned_hull_states_how_far_the_dropped_points_stick_out(seed, count, tolerance):
    points = on_sphere(count, seed)
    kept, rounding = simplify_hull(points, tolerance)
    assert len(kept) <= count
    assert from_hull(points, kept).max() <= rounding + 1e-8
    assert rounding < 2 * tolerance + 1e-9 or len(kept) < 8


@pytest.fixture
def arm_file(tmp_path, monkeypatch):
    """An arm whose base and link are meshes."""
    monkeypatch.setenv("SIDEGAN_CACHE", str(tmp_path / "cache"))
    trimesh.creation.box((0.1, 0.2, 0.7)).export(tmp_path / "box.stl")
    shape = mesh("box.stl", 'xyz="0.1 0 0"')
    (tmp_path / "robot.urdf").write_text(one_joint(collision=shape).replace('"base">', f'"base">{shape}', 1))
    return tmp_path / "robot.urdf"


def assert_same_shapes(arm, other):
    assert arm.digest == other.digest
    for name in ("a", "b", "radius", "core", "corners"):
        assert np.array_equal(getattr(arm.capsules, name), getattr(other.capsules, name))


def test_shapes_are_cached_and_a_damaged_cache_is_rebuilt(arm_file, monkeypatch):
    made = load_robot(arm_file)
    kept = {file: file.stat().st_mtime_ns for file in (arm_file.parent / "cache").rglob("output.pkl")}
    assert_same_shapes(load_robot(arm_file), made)
    assert kept == {file: file.stat().st_mtime_ns for file in kept}  # nothing is made again
    for file in kept:
        file.write_bytes(file.read_bytes()[:20])
    assert_same_shapes(load_robot(arm_file), made)
    monkeypatch.setenv("SIDEGAN_CACHE", str(arm_file))  # no folder: a temporary one is used
    assert_same_shapes(load_robot(arm_file), made)


def test_the_digest_depends_on_meshes_and_origins_not_on_fitted_numbers(arm_file):
    arm = load_robot(arm_file)
    digests = [arm.digest]
    trimesh.creation.box((0.1, 0.2, 0.8)).export(arm_file.with_name("box.stl"))
    digests.append(load_robot(arm_file).digest)
    arm_file.write_text(arm_file.read_text().replace('xyz="0.1 0 0"', 'xyz="0.2 0 0"'))
    digests.append(load_robot(arm_file).digest)
    assert len({*digests}) == 3
    some, numbers = arm.capsules, {"axis": arm.axis}
    shaken = replace(some, a=some.a + 0.01, radius=2 * some.radius)
    assert digest_of(numbers, some) == digest_of(numbers, shaken)


def test_a_ring_around_a_rod_is_refined_until_the_rod_is_free(tmp_path, monkeypatch):
    monkeypatch.setenv("SIDEGAN_CACHE", str(tmp_path / "cache"))
    trimesh.creation.annulus(0.10, 0.12, 0.1, sections=24).export(tmp_path / "ring.stl")
    trimesh.creation.box((0.05, 0.05, 0.4)).export(tmp_path / "rod.stl")  # passes by the ring's wall
    first = joint("first", "base", "lower", origin='xyz="0 0 0"') + link("lower")
    second = joint("second", "lower", "upper", origin='xyz="0.05 0 0"')
    ring, rod = link("base", mesh("ring.stl")), link("upper", INERTIA + mesh("rod.stl"))
    (tmp_path / "robot.urdf").write_text(robot(ring, first, second, rod))
    coarse = load_robot(tmp_path / "robot.urdf", Setup(may_touch=[("base", "upper")]))
    assert coarse.capsules.owners.count("base") <= 4
    fine = load_robot(tmp_path / "robot.urdf")
    assert fine.capsules.owners.count("base") > 4 and fine.capsules.owners.count("upper") == 1
    constraints = Constraints(fine, torque=False)
    judge = Judge(fine.urdf, fine.joint_names, Facts(exempt=constraints.link_pairs.exempt))
    assert shape_accuracy(constraints, judge, 300) == (0.0, 0.0)


@pytest.mark.parametrize(("radius", "refused"), [(0.0668, False), (0.0677, True)])
def test_a_ball_in_a_ring_is_free_or_too_coarse_shapes_are_reported(load, tmp_path, caplog, radius, refused):
    trimesh.creation.annulus(0.068, 0.078, 0.1, sections=48).export(tmp_path / "ring.stl")
    trimesh.creation.icosphere(2, radius).export(tmp_path / "ball.stl")
    place = 'xyz="0 0 0" rpy="0 0 0"'
    turning = [joint("a", "base", "ring"), link("ring", INERTIA + mesh("ring.stl"))]
    turning += [joint("b", "ring", "axle", origin=place, axis="1 0 0"), link("axle")]
    turning += [
        joint("c", "axle", "ball", origin=place, axis="0 1 0"),
        link("ball", INERTIA + mesh("ball.stl")),
    ]
    arm = load(robot(link("base", ""), *turning))
    assert ("ring – ball (98%); if" in caplog.text) == refused == ("too coarse" in caplog.text)
    assert ("leave them unchecked by may_touch=[['ball', 'ring']]" in caplog.text) == refused
    if not refused:
        assert shape_accuracy(Constraints(arm), Judge(arm.urdf, arm.joint_names, Facts()), 200) == (0, 0)
    rows = [k for k, owner in enumerate(arm.capsules.owners) if owner == "ring"]
    points = trimesh.load(tmp_path / "ring.stl").triangles_center[::4]  # covered, although divided
    outside = [from_hull(points, arm.capsules.hulls[k]) - arm.capsules.rounding[k] for k in rows]
    assert np.min(outside, axis=0).max() <= 1e-8 and 20 < len(rows) <= 48
