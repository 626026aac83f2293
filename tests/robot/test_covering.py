"""Covers of meshes: nothing of a mesh is outside, hulls have few corners, and a cache keeps what was made.

Links are cut further where their hulls are in the way, and nowhere else.
"""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.kernels import hulls as kernel
from sidegan.robot import Setup, covers, load_robot
from sidegan.robot.arm import digest_of
from sidegan.robot.capsule_fit import fit, from_segment, hull_volume, volume
from sidegan.robot.covering import cover
from sidegan.robot.hull import thinned
from sidegan.robot.splitting import cut_further, split
from sidegan.validity import Constraints, default_home

from .arms import ROBOTS, shape_accuracy
from .judge import Facts, Judge
from .urdf import INERTIA, joint, link, mesh, one_joint, robot


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


def area(some: np.ndarray) -> float:
    return np.linalg.norm(np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0]), axis=1).sum()


seeds = st.integers(0, 10**6)


@settings(max_examples=8)
@given(seeds, st.integers(1, 40), st.integers(1, 4), st.integers(1, 5), st.sampled_from([0, 9]))
def test_every_point_is_in_the_capsule_and_in_the_hull_of_one_part(seed, count, pieces, meshes, further):
    whole = triangles(seed, count)
    made = covers.make("", np.array_split(whole, min(meshes, count)), pieces, further)
    most = pieces + (meshes - 1 if min(meshes, count) <= pieces else 0)
    assert 1 <= len(made.segments) <= max(most, further)
    shares = np.random.default_rng(seed).dirichlet([1, 1, 1], len(whole))
    points = np.concatenate([whole.reshape(-1, 3), np.einsum("nk,nki->ni", shares, whole)])
    outside = [
        np.maximum(from_segment(ends, points) - radius, from_hull(points, hull) - rounding)
        for (ends, radius), hull, rounding in zip(made.segments, made.corners, made.rounding)
    ]
    assert np.min(outside, axis=0).max() <= 1e-8


def test_an_angle_is_cut_where_it_bends():
    """Two rods that meet at a right angle: one capsule is a fat ball, two are nearly the rods."""
    rods = np.concatenate([box(0.5, 0.02, 0.02, (0.25, 0, 0)), box(0.02, 0.5, 0.02, (0, 0.25, 0))])
    one, two = cover([rods], 1), cover([rods], 2)
    assert len(two) == 2
    assert sum(volume(part.capsule) for part in two) < 0.1 * volume(one[0].capsule)
    assert max(part.radius for part in two) < 0.03


def test_a_plate_is_cut_though_its_hull_takes_no_more_room_than_its_halves():
    (one,), two = (cover([box(0.6, 0.3, 0.02)], most) for most in (1, 2))
    assert len(two) == 2
    assert sum(volume(part.capsule) for part in two) < 0.8 * volume(one.capsule)


def test_meshes_of_a_link_are_parts_of_their_own_where_they_are_not_too_many():
    """A column with a shoulder and a head: planes that save more volume would close the gap between these."""
    meshes = [box(0.4, 0.3, 0.5), *(box(0.1, 0.1, 0.1, (0.25, 0, z)) for z in (-0.2, 0.2))]
    in_the_gap = np.array([[0.27, 0.0, z] for z in (-0.1, 0.0, 0.1)])
    parts = cover(meshes, 3)
    assert 3 <= len(parts) <= 5
    assert min(from_hull(in_the_gap, part.corners).min() for part in parts) > 0.01
    assert len(cover(meshes, 2)) <= 2


def test_a_capsule_is_close_to_the_smallest_around_a_rod_askew():
    random = np.random.default_rng(0)
    axis = np.array([1.0, 2.0, 2.0]) / 3
    points = random.uniform(-0.5, 0.5, (300, 1)) * axis
    beside = np.cross(axis, random.normal(size=(300, 3)))
    points = points + 0.05 * beside / np.linalg.norm(beside, axis=1, keepdims=True)
    capsule = fit(points)
    assert from_segment(capsule[0], points).max() <= capsule[1]
    assert volume(capsule) <= 1.02 * np.pi * 0.05**2 * (4 / 3 * 0.05 + 1.0)


def test_a_plane_divides_triangles_and_leaves_nothing_out():
    random = np.random.default_rng(0)
    whole, normal = random.normal(size=(200, 3, 3)), np.array([1.0, 2.0, 2.0]) / 3
    whole[:20] -= ((whole[:20] @ normal - 0.1)[:, :1, None]) * normal  # a corner in the plane
    below, above = split(whole, normal, 0.1)
    assert (below @ normal).max() <= 0.1 + 1e-12 and (above @ normal).min() >= 0.1 - 1e-12
    assert area(below) + area(above) == pytest.approx(area(whole), rel=1e-12)


@settings(max_examples=20)
@given(seeds, st.integers(5, 400), st.sampled_from([1e-5, 1e-3, 1e-2]))
def test_a_thinned_hull_tells_how_far_the_rest_sticks_out(seed, count, tolerance):
    points = on_sphere(count, seed)
    kept, rounding = thinned(points, tolerance)
    assert len(kept) <= count
    assert from_hull(points, kept).max() <= rounding + 1e-8
    assert rounding < 2 * tolerance + 1e-9 or len(kept) < 8


def test_a_thinned_hull_does_not_depend_on_where_the_body_is_or_what_is_inside():
    points, place = on_sphere(300), np.array([3.0, -2.0, 5.0])
    here, rounding = thinned(points, 1e-2)
    assert rounding > 1e-3
    there, same = thinned(np.concatenate([points, 0.5 * points]) + place, 1e-2)
    np.testing.assert_allclose(there - place, here, rtol=0, atol=1e-12)
    assert same == pytest.approx(rounding, rel=1e-9)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv(covers.VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache" / "shapes"


@pytest.fixture
def arm_file(tmp_path, cache):
    """An arm whose base and link are meshes."""
    trimesh.creation.box((0.1, 0.2, 0.7)).export(tmp_path / "box.stl")
    shape = mesh("box.stl", 'xyz="0.1 0 0"')
    (tmp_path / "robot.urdf").write_text(one_joint(collision=shape).replace('"base">', f'"base">{shape}', 1))
    return tmp_path / "robot.urdf"


def accuracy_of(arm, configurations):
    """As ``shape_accuracy``, of the pairs that the arm keeps apart or says never to touch."""
    constraints = Constraints(arm, torque=False)
    exempt = [list(one.links) for one in constraints.exempt if one.why != "never touch"]
    judge = Judge(arm.urdf, arm.joint_names, Facts(exempt=exempt))
    return shape_accuracy(constraints, judge, configurations)


def assert_same_shapes(one, other):
    assert one.digest == other.digest and one.capsules.owners == other.capsules.owners
    for name in ("link", "a", "b", "radius"):
        assert torch.equal(getattr(one.capsules, name), getattr(other.capsules, name))
    for name in ("corners", "start", "radius", "fitted", "core"):
        assert torch.equal(getattr(one.capsules.pieces, name), getattr(other.capsules.pieces, name))


COARSE = Setup(pieces=2, finer=2)


class TestCache:
    def test_gives_back_what_was_made(self, arm_file, monkeypatch):
        made = load_robot(arm_file, COARSE)
        monkeypatch.setattr(covers, "make", None)  # nothing is made again
        assert_same_shapes(load_robot(arm_file, COARSE), made)

    def test_that_is_broken_is_made_again(self, arm_file, cache):
        made = load_robot(arm_file, COARSE)
        (file,) = cache.iterdir()
        for content in (b"", b"PK\x03\x04", file.read_bytes()[:200]):
            file.write_bytes(content)
            assert_same_shapes(load_robot(arm_file, COARSE), made)

    def test_that_cannot_be_written_costs_time_only(self, arm_file, monkeypatch):
        monkeypatch.setenv(covers.VARIABLE, str(arm_file))
        assert load_robot(arm_file, COARSE).capsules.names

    def test_knows_other_meshes_other_pieces_and_other_ways(self, arm_file, monkeypatch):
        arm = load_robot(arm_file, COARSE)
        digests = [arm.digest, load_robot(arm_file, Setup(pieces=1, finer=2)).digest]
        monkeypatch.setattr(covers, "VERSION", covers.VERSION + 1)
        digests.append(load_robot(arm_file, COARSE).digest)
        trimesh.creation.box((0.1, 0.2, 0.8)).export(arm_file.with_name("box.stl"))
        digests.append(load_robot(arm_file, COARSE).digest)
        arm_file.write_text(arm_file.read_text().replace('xyz="0.1 0 0"', 'xyz="0.2 0 0"'))
        digests.append(load_robot(arm_file, COARSE).digest)
        assert len({*digests}) == 5
        some, numbers = arm.capsules, {"axis": arm.axis}  # numbers of the fit do not count
        shaken = replace(some, a=some.a + 0.01, radius=2 * some.radius)
        assert digest_of(numbers, some) == digest_of(numbers, shaken)


def test_a_ring_around_a_rod_is_cut_until_the_rod_is_free_and_that_is_kept(tmp_path, cache, monkeypatch):
    trimesh.creation.annulus(0.10, 0.12, 0.1, sections=24).export(tmp_path / "ring.stl")
    trimesh.creation.box((0.03, 0.03, 0.4)).export(tmp_path / "rod.stl")  # far from the ring's wall
    first = joint("first", "base", "lower", origin='xyz="0 0 0"') + link("lower")
    second = joint("second", "lower", "upper", origin='xyz="0.02 0 0"')
    ring, rod = link("base", mesh("ring.stl")), link("upper", INERTIA + mesh("rod.stl"))
    ring_file = tmp_path / "robot.urdf"
    ring_file.write_text(robot(ring, first, second, rod))
    coarse = load_robot(ring_file, Setup(pieces=2, finer=2, may_touch=[("base", "upper")]))
    assert coarse.capsules.owners.count("base") <= 2
    fine = load_robot(ring_file, Setup(pieces=2))
    assert fine.capsules.owners.count("base") > 2
    assert fine.capsules.owners.count("upper") == 1
    assert accuracy_of(fine, 300) == (0.0, 0.0)
    others = [Setup(pieces=2, finer=4), Setup(pieces=1)]
    assert len({fine.digest, *(load_robot(ring_file, setup).digest for setup in others)}) == 3
    monkeypatch.setattr("sidegan.robot.refining._Scene", None)  # nothing is looked for again
    assert_same_shapes(load_robot(ring_file, Setup(pieces=2)), fine)


def test_cuts_leave_out_what_is_empty():
    """Of a tube's hull two thirds are empty: sixteen parts leave out nearly all of that."""
    tube = trimesh.creation.annulus(0.08, 0.1, 0.2, sections=48)
    parts = cut_further([np.asarray(tube.triangles)], 16)
    assert 4 <= len(parts) <= 16
    assert sum(hull_volume(part.reshape(-1, 3)) for part in parts) < 1.2 * tube.volume
    (whole,) = cut_further([box(1, 2, 3)], 16)
    assert len(whole) == 12


@pytest.mark.skipif(ROBOTS is None, reason="needs example-robot-data, the extra arms")
def test_more_pieces_of_a_stock_arm_refuse_less_and_miss_nothing():
    """Zeros are refused by one capsule a link, and by meshes they are not."""
    path = ROBOTS / "ur_description/urdf/ur10_robot.urdf"
    few, many = (load_robot(path, Setup(pieces=pieces, finer=pieces)) for pieces in (1, 4))
    assert len(few.capsules.names) < len(many.capsules.names) and few.digest != many.digest
    (more, missed), (less, none) = (accuracy_of(arm, 500) for arm in (few, many))
    assert missed == none == 0
    assert more > 0.1 and less < 0.01  # the hull of a whole forearm is too much
    constraints = Constraints(load_robot(path))
    assert default_home(constraints) is None
    constraints.refuse_home([0.0, -1.5708, 0.0, -1.5708, 0.0, 0.0])
