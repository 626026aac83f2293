"""Looks of an arm: its visual shapes, where the description has them."""

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from sidegan.robot import load_robot
from sidegan.robot.visuals import visual_parts

from .urdf import INERTIA, ball, joint, link, robot, visual

BOX = visual('<box size="0.2 0.3 0.4"/>')
ROD = visual('<cylinder radius="0.05" length="0.4"/>', 'xyz="0 0.1 0.2" rpy="1 0.5 0.2"')
PLATE = visual('<mesh filename="plate.stl" scale="0.1 0.1 0.1"/>', 'xyz="0.3 0 0"')
URDF = robot(
    link("base", BOX + visual('<mesh filename="package://nowhere/lost.stl"/>')),
    joint("turn", "base", "arm", origin='xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"'),
    link("arm", INERTIA + ROD),
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
