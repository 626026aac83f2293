"""A capsule never lets the shape it stands for stick out; visual shapes are where a description has them."""

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from sidegan.robot import load_robot
from sidegan.robot.visuals import visual_parts

from .urdf import INERTIA, ball, collision, joint, link, mesh, one_joint, outside, robot, visual

ROD = '<cylinder radius="0.1" length="0.6"/>'
BOX = collision('<box size="0.1 0.2 0.7"/>', 'xyz="1 0 0"')
CORNERS = trimesh.creation.box((0.1, 0.2, 0.7)).vertices  # of this box, around the origin [m], (8, 3)


def beyond(points, arm):
    """How far points (N, 3) are outside of all capsules of an arm's only link [m]."""
    shapes = zip(arm.capsules.a, arm.capsules.b, arm.capsules.radius.tolist())
    return np.min([outside(points, *shape) for shape in shapes], axis=0).max()


MARKED = collision(ROD, 'xyz="0 0 1" rpy="0 1.5707963267948966 0"', ' name="c"')
CHECKED = '<collision_checking><{} name="c"/></collision_checking>'


EXACT = [
    (ball(0.2, "1 2 3"), [[1, 2, 3]] * 2, 0.2),
    (MARKED + CHECKED.format("capsule"), [[-0.3, 0, 1], [0.3, 0, 1]], 0.1),
    (MARKED.replace("cylinder", "capsule"), [[-0.3, 0, 1], [0.3, 0, 1]], 0.1),
]


@pytest.mark.parametrize(("words", "ends", "radius"), EXACT)
def test_spheres_and_capsules_are_exact(load, words, ends, radius):
    capsules = load(one_joint(collision=words)).capsules
    np.testing.assert_allclose(np.concatenate([capsules.a, capsules.b]), ends, atol=1e-15)
    assert capsules.radius.tolist() == [radius] and capsules.owners == ("arm",)


def test_boxes_and_cylinders_keep_their_shape_inside_their_capsules(load):
    arm = load(one_joint(collision=BOX + collision(ROD) + ball(0.2)))
    box, cylinder, sphere = arm.capsules.hulls
    expected = CORNERS + np.array([1, 0, 0])
    rim = np.array([[0.1, 0, 0.3], [0, 0.1, 0.3], [0.1, 0, -0.3], [-0.1, 0, -0.3]])
    assert beyond(expected, arm) <= 1e-12 and beyond(rim, arm) <= 1e-12
    assert arm.capsules.radius[0] < np.linalg.norm([0.1, 0.2, 0.7]) / 2
    np.testing.assert_allclose(np.unique(box, axis=0), np.unique(expected, axis=0))
    assert np.abs(cylinder[:, 2]).tolist() == pytest.approx([0.3] * len(cylinder))
    assert 0.1 < np.linalg.norm(cylinder[:, :2], axis=1).max() < 0.1002  # a prism around it
    assert arm.capsules.exact.tolist() == [False, False, True]
    assert arm.capsules.rounding.tolist() == [0, 0, 0.2] and not arm.capsules.fitted.any()
    assert sphere.tolist() == [[0, 0, 0]] * 2
    assert load(one_joint()).capsules.a.shape == (0, 3)


def test_a_mesh_is_inside_its_capsule(load, tmp_path):
    """A box of 100 x 200 x 700 mm, in millimetres, in a package beside the URDF."""
    file = tmp_path / "arm_description" / "meshes" / "box.stl"
    file.parent.mkdir(parents=True)
    trimesh.creation.box((100, 200, 700)).export(file)
    text = one_joint(collision=mesh("package://arm_description/meshes/box.stl", scale="0.001 0.001 0.001"))
    arm = load(text)
    assert beyond(CORNERS, arm) <= 1e-7  # meshes are read in float32
    assert arm.capsules.radius.max() < 0.2
    assert set(arm.capsules.owners) == {"arm"}
    named = text.replace("<collision>", '<collision name="c">')
    marked = named.replace("</collision>", "</collision>" + CHECKED.format("convex"))
    assert load(marked).digest == load(named).digest == arm.digest


LOOK = visual('<box size="0.2 0.3 0.4"/>')
ARM = visual('<cylinder radius="0.05" length="0.4"/>', 'xyz="0 0.1 0.2" rpy="1 0.5 0.2"')
PLATE = visual('<mesh filename="plate.stl" scale="0.1 0.1 0.1"/>', 'xyz="0.3 0 0"')
URDF = robot(
    link("base", LOOK + visual('<mesh filename="package://nowhere/lost.stl"/>')),
    joint("turn", "base", "arm", origin='xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"'),
    link("arm", INERTIA + ARM),
    joint("wrist", "arm", "hand", origin='xyz="0 0 0.4" rpy="0.1 0 0"', axis="0 1 0"),
    link("hand", PLATE),
    joint("weld", "hand", "tool", "fixed", 'xyz="0 0 0.2" rpy="0 0 1"', limit=""),
    link("tool", ball(0.03, "0.1 0 0")),
)


@pytest.fixture
def file(tmp_path):
    """An arm with primitive shapes, a mesh that is lost, and one that is a triangle."""
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [[0, 1, 2]]).export(tmp_path / "plate.stl")
    (tmp_path / "two.urdf").write_text(URDF)
    return tmp_path / "two.urdf"


def test_visuals_are_where_the_description_has_them(file):
    parts = visual_parts(load_robot(file))
    assert [part.link for part in parts] == [-1, 0, 1, 1]
    box, rod, plate, sphere = parts
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), [0.2, 0.3, 0.4], atol=1e-12)
    turn = pin.rpy.rpyToMatrix(1.0, 0.5, 0.2)
    np.testing.assert_allclose(rod.vertices.mean(0), [0, 0.1, 0.2], atol=1e-12)
    local = (rod.vertices - [0, 0.1, 0.2]) @ turn
    np.testing.assert_allclose(np.abs(local[:, 2]).max(), 0.2, atol=1e-12)
    np.testing.assert_allclose(np.hypot(*local[:, :2].T).max(), 0.05, atol=1e-12)
    np.testing.assert_allclose(plate.vertices.max(0), [0.4, 0.2, 0], atol=1e-7)
    centre = np.array([0.1 * np.cos(1), 0.1 * np.sin(1), 0.2])
    np.testing.assert_allclose(np.linalg.norm(sphere.vertices - centre, axis=1), 0.03, atol=1e-9)


def test_a_deleted_description_leaves_only_collision_shapes(file, caplog):
    arm = load_robot(file)
    file.unlink()
    assert visual_parts(arm) == [] and "is shown with its collision shapes only" in caplog.text
