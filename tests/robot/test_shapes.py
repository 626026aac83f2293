"""A capsule never lets the shape it stands for stick out."""

import logging

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sidegan.errors import RobotError
from sidegan.robot.enclosing import around_cylinder, around_points

from .urdf import joint, link, one_joint, robot

sizes = st.floats(1e-3, 10.0)


def beyond(points, ends, radius):
    """How far the outermost of the points (N, 3) is outside the capsule [m]."""
    along = ends[1] - ends[0]
    share = np.clip((points - ends[0]) @ along / max(along @ along, 1e-300), 0.0, 1.0)
    return (np.linalg.norm(points - ends[0] - np.outer(share, along), axis=1) - radius).max()


def collision(shape: str, origin: str = 'xyz="0 0 0"', name: str = "") -> str:
    return f"<collision{name}><origin {origin}/><geometry>{shape}</geometry></collision>"


def corners(x, y, z):
    return np.array(np.meshgrid([-x / 2, x / 2], [-y / 2, y / 2], [-z / 2, z / 2])).reshape(3, 8).T


def ends_of(arm, i=0):
    return np.stack([arm.capsules.a[i], arm.capsules.b[i]])


@settings(deadline=None)
@given(sizes, sizes)
def test_holds_a_cylinder(radius, half_length):
    ends, wide = around_cylinder(radius, half_length)
    angle = np.linspace(0, 2 * np.pi, 30)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(30, half_length)], 1)
    assert beyond(np.concatenate([rim, rim * [1, 1, -1]]), ends, wide) <= 1e-12 * wide
    assert wide <= np.hypot(radius, half_length) * (1 + 1e-12)  # never worse than a sphere


@settings(deadline=None)
@given(arrays(np.float64, st.tuples(st.integers(1, 30), st.just(3)), elements=st.floats(-5, 5)))
def test_holds_any_points(points):
    ends, radius = around_points(points)
    assert beyond(points, ends, radius) <= 1e-9


def test_is_tight_around_a_rod_that_lies_askew():
    direction = np.array([1.0, 2.0, 2.0]) / 3.0
    rod = np.linspace(-1, 1, 50)[:, None] * direction
    around = np.concatenate([rod + 0.01 * np.cross(direction, axis) for axis in (*np.eye(3), *-np.eye(3))])
    ends, radius = around_points(around)
    assert radius < 0.02
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(2.0, abs=0.03)


def test_a_sphere_is_a_capsule_without_length(load):
    arm = load(one_joint(collision=collision('<sphere radius="0.2"/>', 'xyz="1 2 3"')))
    assert arm.capsules.a.tolist() == arm.capsules.b.tolist() == [[1, 2, 3]]
    assert arm.capsules.radius.tolist() == [0.2]
    assert arm.capsules.names == ("arm",)


MARKED = collision(
    '<cylinder radius="0.1" length="0.6"/>', 'xyz="0 0 1" rpy="0 1.5707963267948966 0"', ' name="c"'
)


@pytest.mark.parametrize(
    "words",
    [
        MARKED + '<collision_checking><capsule name="c"/></collision_checking>',
        MARKED.replace("cylinder", "capsule"),
    ],
)
def test_both_ways_to_write_a_capsule(load, words):
    arm = load(one_joint(collision=words))
    np.testing.assert_allclose(ends_of(arm), [[-0.3, 0, 1], [0.3, 0, 1]], atol=1e-15)
    assert arm.capsules.radius.tolist() == [0.1]


def test_a_plain_cylinder_has_flat_ends_inside_the_capsule(load):
    arm = load(one_joint(collision=collision('<cylinder radius="0.1" length="0.6"/>', 'xyz="0 0 1"')))
    rim = np.array([[0.1, 0, 1.3], [0, 0.1, 1.3], [0.1, 0, 0.7], [-0.1, 0, 0.7]])
    assert beyond(rim, ends_of(arm), arm.capsules.radius.item()) <= 1e-12


def test_a_box_is_inside_its_capsule(load):
    arm = load(one_joint(collision=collision('<box size="0.1 0.2 0.7"/>', 'xyz="1 0 0"')))
    box = corners(0.1, 0.2, 0.7) + np.array([1, 0, 0])
    assert beyond(box, ends_of(arm), arm.capsules.radius.item()) <= 1e-12
    assert arm.capsules.radius.item() < np.linalg.norm([0.1, 0.2, 0.7]) / 2


def test_several_shapes_of_a_link_have_names_of_their_own(load):
    arm = load(one_joint(collision=collision('<sphere radius="0.2"/>') * 2))
    assert arm.capsules.names == ("arm_0", "arm_1")


def test_shapes_behind_fixed_joints_move_with_the_link_that_carries_them(load):
    ball = collision('<sphere radius="0.1"/>')
    arm = load(
        robot(
            link("base", ball),
            joint("mount", "base", "pillar", "fixed", 'xyz="0 0 2"'),
            link("pillar", ball),
            joint("turn", "pillar", "arm"),
            link("arm"),
            joint("grip", "arm", "tool", "fixed", 'xyz="0 0 0.5"'),
            link("tool", ball),
        )
    )
    where = dict(zip(arm.capsules.names, zip(arm.capsules.link.tolist(), arm.capsules.a.tolist())))
    assert where == {"base": (-1, [0, 0, 0]), "pillar": (-1, [0, 0, 2]), "tool": (0, [0, 0, 0.5])}


def test_a_box_and_a_cylinder_stay_what_they_are_inside_of_their_capsules(load):
    both = collision('<box size="0.1 0.2 0.7"/>', 'xyz="1 0 0"') + collision(
        '<cylinder radius="0.1" length="0.6"/>'
    )
    pieces = load(one_joint(collision=both + collision('<sphere radius="0.2"/>'))).capsules.pieces
    box, cylinder, sphere = pieces.corners.split(pieces.start.diff().tolist())
    np.testing.assert_allclose(
        np.unique(box, axis=0), np.unique(corners(0.1, 0.2, 0.7) + np.array([1, 0, 0]), axis=0)
    )
    assert cylinder[:, 2].abs().tolist() == pytest.approx([0.3] * len(cylinder))
    assert 0.1 < cylinder[:, :2].norm(dim=1).max() < 0.1002  # a prism around it
    assert pieces.exact.tolist() == [False, False, True] and pieces.radius.tolist() == [0, 0, 0.2]
    assert sphere.tolist() == [[0, 0, 0]] * 2 and not pieces.fitted.any()


def test_an_arm_without_shapes_has_no_capsules(load):
    arm = load(one_joint())
    assert arm.capsules.a.shape == arm.capsules.b.shape == (0, 3)
    assert arm.capsules.link.dtype == torch.long


def stl(points) -> str:
    """An STL of triangles that together touch every point."""
    triangles = [
        (points[i], points[(i + 1) % len(points)], points[(i + 2) % len(points)]) for i in range(len(points))
    ]
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in triangle)
        + "endloop\nendfacet\n"
        for triangle in triangles
    )
    return f"solid box\n{facets}endsolid box\n"


class TestMeshes:
    @pytest.fixture
    def mesh(self, tmp_path):
        """A box of 100 x 200 x 700 mm, in millimetres, in a package beside the URDF."""
        file = tmp_path / "arm_description" / "meshes" / "box.stl"
        file.parent.mkdir(parents=True)
        file.write_text(stl(corners(100, 200, 700)))
        return file

    @staticmethod
    def text(filename) -> str:
        return one_joint(collision=collision(f'<mesh filename="{filename}" scale="0.001 0.001 0.001"/>'))

    @pytest.mark.parametrize(
        "filename",
        [
            "arm_description/meshes/box.stl",
            "package://arm_description/meshes/box.stl",
            "file://{absolute}",
            "{absolute}",
        ],
    )
    def test_is_inside_its_capsule(self, load, mesh, filename):
        arm = load(self.text(filename.format(absolute=mesh)))
        outside = [
            [
                beyond(corner[None], ends_of(arm, k), radius)
                for k, radius in enumerate(arm.capsules.radius.tolist())
            ]
            for corner in corners(0.1, 0.2, 0.7)
        ]
        assert np.min(outside, axis=1).max() <= 1e-7  # meshes are read in float32
        assert arm.capsules.radius.max() < 0.2
        assert set(arm.capsules.names) == set(arm.capsules.owners) == {"arm"}

    def test_that_is_marked_as_convex_is_inside_its_capsule(self, load, mesh):
        text = self.text(mesh).replace("<collision>", '<collision name="hull">')
        marked = text.replace(
            "</collision>", '</collision><collision_checking><convex name="hull"/></collision_checking>'
        )
        assert load(marked).digest == load(text).digest

    @pytest.mark.parametrize("variable", ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
    def test_is_found_on_the_ros_paths(self, load, mesh, tmp_path, monkeypatch, variable):
        share = tmp_path / "elsewhere" / "share"
        share.mkdir(parents=True)
        mesh.parents[1].rename(share / "arm_description")
        monkeypatch.setenv(variable, str(share if variable == "ROS_PACKAGE_PATH" else share.parent))
        assert load(self.text("package://arm_description/meshes/box.stl")).capsules.names

    def test_that_is_missing_leaves_a_warning_that_names_the_link(self, load, caplog):
        with caplog.at_level(logging.WARNING):
            arm = load(self.text("package://gone/box.stl"))
        assert arm.capsules.names == ()
        assert "arm" in caplog.text and "mesh files are missing" in caplog.text

    def test_that_is_no_mesh_is_refused(self, load, mesh):
        mesh.write_text("no mesh")
        with pytest.raises(RobotError, match=r"box\.stl"):
            load(self.text(mesh))
