"""Covers of meshes: nothing of a mesh is outside, hulls have few corners, and a cache keeps what was made."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.errors import RobotError
from sidegan.robot import Setup, covers, load_robot
from sidegan.robot.arm import digest_of
from sidegan.robot.capsule_fit import fit, from_segment, hull_volume, volume
from sidegan.robot.covering import _Cutter, cover, subdivided
from sidegan.robot.hull import thinned
from sidegan.robot.kept import save_shapes
from sidegan.validity.hulls import apart

from .test_shapes import collision, corners, stl
from .urdf import one_joint


def mesh(seed: int, triangles: int) -> np.ndarray:
    """Random triangles [m], (N, 3, 3), small ones and large ones, some of them degenerate."""
    random = np.random.default_rng(seed)
    size = 10.0 ** random.uniform(-3, -0.5, (triangles, 1, 1))
    made = random.uniform(-0.4, 0.4, (triangles, 1, 3)) + size * random.normal(size=(triangles, 3, 3))
    made[:: max(2, triangles // 2), 1] = made[:: max(2, triangles // 2), 0]
    return made * random.uniform(0.05, 1.0, 3)


def points_on(triangles: np.ndarray, seed: int) -> np.ndarray:
    """The corners of triangles, and points on them, (M, 3)."""
    shares = np.random.default_rng(seed).dirichlet([1, 1, 1], len(triangles))
    return np.concatenate([triangles.reshape(-1, 3), np.einsum("nk,nki->ni", shares, triangles)])


def from_hull(points: np.ndarray, hull: np.ndarray) -> np.ndarray:
    """Distance [m], (N,), of points (N, 3) from a hull; 0 inside."""
    still = np.tile(np.eye(3), (len(points), 1, 1))
    found = apart((hull, still, np.zeros_like(points)), (np.zeros((1, 3)), still, points))
    return np.maximum(found, 0.0)


@settings(max_examples=15)
@given(
    st.integers(0, 10**6), st.integers(1, 60), st.integers(1, 4), st.integers(1, 5), st.sampled_from([0, 9])
)
def test_every_point_is_in_the_capsule_and_in_the_hull_of_one_part(seed, triangles, pieces, meshes, further):
    whole = mesh(seed, triangles)
    made = covers.make("", np.array_split(whole, min(meshes, triangles)), pieces, further)
    most = pieces + (meshes - 1 if min(meshes, triangles) <= pieces else 0)
    assert 1 <= len(made.segments) <= max(most, further)
    points = points_on(whole, seed)
    outside = [
        np.maximum(from_segment(ends, points) - radius, from_hull(points, hull) - rounding)
        for (ends, radius), hull, rounding in zip(made.segments, made.corners, made.rounding)
    ]
    assert np.min(outside, axis=0).max() <= 1e-8


def test_an_angle_is_cut_where_it_bends():
    """Two rods that meet at a right angle: one capsule is a fat ball, two are nearly the rods."""
    shift = np.array([[0.25, 0, 0], [0, 0.25, 0]])
    rods = np.concatenate([box_mesh(0.5, 0.02, 0.02) + shift[0], box_mesh(0.02, 0.5, 0.02) + shift[1]])
    one, two = cover([rods], 1), cover([rods], 2)
    assert len(two) == 2
    assert sum(volume(part.capsule) for part in two) < 0.1 * volume(one[0].capsule)
    assert max(part.radius for part in two) < 0.03


def test_what_further_cuts_are_chosen_by_is_of_each_parts_own_triangles():
    """Three rods in the shape of a U, cut twice."""
    places = {(0.5, 0.02, 0.02): [[0, -0.25, 0], [0, 0.25, 0]], (0.02, 0.5, 0.02): [[0.25, 0, 0]]}
    rods = [box_mesh(*size) + place for size, some in places.items() for place in np.array(some)]
    cutter = _Cutter([subdivided(np.concatenate(rods), 0.05)])
    for count in (2, 3):
        assert cutter.cut() is not None and cutter.count == count
        own = [cutter.triangles[cutter.owner == k].reshape(-1, 3) for k in range(count)]
        assert cutter.hulls == pytest.approx([hull_volume(points) for points in own], rel=1e-9)
        for points, filled in zip(own, cutter.filled):
            np.testing.assert_array_equal(filled, cutter._filled(fit(points)))


def test_one_mesh_is_always_cut_by_the_same_measure():
    cube = subdivided(box_mesh(0.4, 0.4, 0.4), 0.1)
    one, again = (_Cutter([cube]) for _ in range(2))
    np.testing.assert_array_equal(one.filled, again.filled)


def test_a_plate_is_cut_though_its_hull_takes_no_more_room_than_its_halves():
    (one,), two = (cover([box_mesh(0.6, 0.3, 0.02)], most) for most in (1, 2))
    assert len(two) == 2
    assert sum(volume(part.capsule) for part in two) < 0.8 * volume(one.capsule)


def test_meshes_of_a_link_are_parts_of_their_own_where_they_are_not_too_many():
    """A column with a shoulder and a head: planes that save more volume would close the gap between these."""
    column = box_mesh(0.4, 0.3, 0.5)
    shoulder, head = (box_mesh(0.1, 0.1, 0.1) + np.array([0.25, 0, z]) for z in (-0.2, 0.2))
    in_the_gap = np.array([[0.27, 0.0, z] for z in (-0.1, 0.0, 0.1)])
    parts = cover([column, shoulder, head], 3)
    assert 3 <= len(parts) <= 5
    assert min(from_hull(in_the_gap, part.corners).min() for part in parts) > 0.01
    assert len(cover([column, shoulder, head], 2)) <= 2


def box_mesh(x: float, y: float, z: float) -> np.ndarray:
    """Triangles of a box, (12, 3, 3)."""
    from scipy.spatial import ConvexHull

    points = corners(x, y, z)
    return points[ConvexHull(points).simplices]


def test_a_capsule_is_close_to_the_smallest_around_a_rod_askew():
    random = np.random.default_rng(0)
    axis = np.array([1.0, 2.0, 2.0]) / 3
    points = random.uniform(-0.5, 0.5, (300, 1)) * axis
    beside = np.cross(axis, random.normal(size=(300, 3)))
    points = points + 0.05 * beside / np.linalg.norm(beside, axis=1, keepdims=True)
    capsule = fit(points)
    assert from_segment(capsule[0], points).max() <= capsule[1]
    assert volume(capsule) <= 1.02 * np.pi * 0.05**2 * (4 / 3 * 0.05 + 1.0)


def test_subdividing_keeps_the_surface():
    whole = mesh(1, 20)
    fine = subdivided(whole, 0.05)

    def area(triangles):
        return (
            np.linalg.norm(np.cross(*(triangles[:, k] - triangles[:, 0] for k in (1, 2))), axis=1).sum() / 2
        )

    assert area(fine) == pytest.approx(area(whole), rel=1e-9)
    assert np.linalg.norm(np.roll(fine, -1, axis=1) - fine, axis=2).max() <= 0.05


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.integers(5, 400), st.sampled_from([1e-5, 1e-3, 1e-2]))
def test_a_thinned_hull_tells_how_far_the_rest_sticks_out(seed, count, tolerance):
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3))
    points *= 0.1 / np.linalg.norm(points, axis=1, keepdims=True)
    kept, rounding = thinned(points, tolerance)
    assert len(kept) <= count
    assert from_hull(points, kept).max() <= rounding + 1e-8
    assert rounding < 2 * tolerance + 1e-9 or len(kept) < 8


def test_a_thinned_hull_does_not_depend_on_where_the_body_is_or_what_is_inside():
    random = np.random.default_rng(0)
    points = random.normal(size=(300, 3))
    points *= 0.1 / np.linalg.norm(points, axis=1, keepdims=True)
    here, rounding = thinned(points, 1e-2)
    assert rounding > 1e-3
    place = np.array([3.0, -2.0, 5.0])
    there, same = thinned(np.concatenate([points, 0.5 * points]) + place, 1e-2)
    np.testing.assert_allclose(there - place, here, rtol=0, atol=1e-12)
    assert same == pytest.approx(rounding, rel=1e-9)


class TestCache:
    @pytest.fixture
    def arm_file(self, tmp_path, monkeypatch):
        """An arm whose link is a mesh, and an empty cache."""
        monkeypatch.setenv(covers.VARIABLE, str(tmp_path / "cache"))
        (tmp_path / "box.stl").write_text(stl(corners(0.1, 0.2, 0.7)))
        file = tmp_path / "robot.urdf"
        file.write_text(one_joint(collision=collision('<mesh filename="box.stl"/>', 'xyz="0.1 0 0"')))
        return file

    def test_gives_back_what_was_made(self, arm_file, monkeypatch):
        made = load_robot(arm_file)
        monkeypatch.setattr(covers, "make", None)  # nothing is made again
        again = load_robot(arm_file)
        assert again.digest == made.digest
        for name in ("a", "b", "radius"):
            assert torch.equal(getattr(again.capsules, name), getattr(made.capsules, name))
        assert torch.equal(again.capsules.pieces.corners, made.capsules.pieces.corners)

    def test_that_is_broken_is_made_again(self, arm_file, tmp_path):
        made = load_robot(arm_file)
        (file,) = (tmp_path / "cache" / "shapes").iterdir()
        for content in (b"", b"PK\x03\x04", file.read_bytes()[:200]):
            file.write_bytes(content)
            assert torch.equal(load_robot(arm_file).capsules.a, made.capsules.a)

    def test_that_cannot_be_written_costs_time_only(self, arm_file, tmp_path, monkeypatch):
        (tmp_path / "file").touch()
        monkeypatch.setenv(covers.VARIABLE, str(tmp_path / "file"))
        assert load_robot(arm_file).capsules.names

    def test_knows_other_meshes_other_pieces_and_other_ways(self, arm_file, monkeypatch):
        def digest():
            return load_robot(arm_file).digest

        first = digest()
        monkeypatch.setattr(covers, "VERSION", covers.VERSION + 1)
        other = digest()
        (arm_file.parent / "box.stl").write_text(stl(corners(0.1, 0.2, 0.8)))
        third = digest()
        arm_file.write_text(arm_file.read_text().replace('xyz="0.1 0 0"', 'xyz="0.2 0 0"'))
        assert len({first, other, third, digest()}) == 4

    def test_digest_does_not_depend_on_the_numbers_of_the_fit(self, arm_file):
        arm = load_robot(arm_file)
        numbers = {"axis": arm.axis}
        shaken = type(arm.capsules)(
            arm.capsules.link, arm.capsules.a + 0.01, arm.capsules.b, 2 * arm.capsules.radius,
            arm.capsules.names, arm.capsules.owners, arm.capsules.pieces,
        )  # fmt: skip
        assert digest_of(numbers, arm.capsules) == digest_of(numbers, shaken)


class TestKept:
    """Shapes in a file stand for meshes that are gone."""

    @pytest.fixture
    def arm_file(self, tmp_path):
        (tmp_path / "box.stl").write_text(stl(corners(0.1, 0.2, 0.7)))
        file = tmp_path / "robot.urdf"
        mesh = collision('<mesh filename="box.stl"/>', 'xyz="0.1 0 0"')
        file.write_text(one_joint(collision=mesh).replace('<link name="base">', f'<link name="base">{mesh}'))
        return file

    def test_make_the_same_arm(self, arm_file, tmp_path, caplog):
        arm = load_robot(arm_file)
        assert save_shapes(arm, tmp_path / "shapes.npz")
        (tmp_path / "box.stl").unlink()
        assert load_robot(arm_file).capsules.names == ()
        assert "mesh files are missing" in caplog.text
        caplog.clear()
        again = load_robot(arm_file, Setup(shapes=str(tmp_path / "shapes.npz")))
        assert caplog.text == ""
        assert again.digest == arm.digest
        assert again.capsules.owners == arm.capsules.owners
        for name in ("link", "a", "b", "radius"):
            assert torch.equal(getattr(again.capsules, name), getattr(arm.capsules, name))
        for name in ("corners", "start", "radius", "fitted", "core"):
            assert torch.equal(getattr(again.capsules.pieces, name), getattr(arm.capsules.pieces, name))

    def test_notice_that_the_meshes_are_elsewhere(self, arm_file, tmp_path):
        save_shapes(load_robot(arm_file), tmp_path / "shapes.npz")
        (tmp_path / "box.stl").unlink()
        arm_file.write_text(arm_file.read_text().replace('xyz="0.1 0 0"', 'xyz="0.1 0 0.02"', 1))
        with pytest.raises(RobotError, match="meshes of link 'base' are elsewhere") as refused:
            load_robot(arm_file, Setup(shapes=str(tmp_path / "shapes.npz")))
        assert "robot.shapes=null" in str(refused.value)
        assert load_robot(arm_file, Setup(shapes=None)).capsules.names == ()

    def test_of_an_arm_without_meshes_are_none(self, tmp_path):
        assert not save_shapes(load_robot("kuka_lwr4"), tmp_path / "shapes.npz")
        assert not (tmp_path / "shapes.npz").exists()

    def test_that_are_not_there_or_no_shapes_are_refused(self, arm_file, tmp_path):
        with pytest.raises(RobotError, match=r"there is no file robot\.shapes="):
            load_robot(arm_file, Setup(shapes=str(tmp_path / "gone.npz")))
        with pytest.raises(RobotError, match="holds no shapes"):
            load_robot(arm_file, Setup(shapes=str(arm_file)))
