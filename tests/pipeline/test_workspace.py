"""What surrounds an arm: every kind of region, and the floor under arms of strangers."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sidegan.errors import ConfigError
from sidegan.robot import Setup, load_robot
from sidegan.robot.load import _MODELS
from sidegan.validity import Convex, Plane, Sphere
from tests.refusals import refused
from tests.tiny import tiny

DESK = {"plane": {"normal": (0.0, 0.0, 1.0), "offset": 0.1}, "box": None}
BALL = "{sphere: {centre: [2, 0, 0], radius: 0.1}}"
PLANAR = (_MODELS / "planar2.urdf").read_text()


def workspace(*regions, choice="free"):
    return tiny(f"workspace={choice}", f"workspace.regions=[{','.join(regions)}]").workspace


def tetrahedron(path: Path, scale: float = 1.0) -> str:
    """A region: the mesh, at a tenth of its size, of an OBJ file of four corners."""
    corners = scale * np.vstack([np.zeros(3), np.eye(3)])
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    path.write_text("\n".join(lines) + "\n")
    return f"{{mesh: {{file: {path}, position: [0, 0, 2], rpy: [0, 0, 0], scale: 0.1}}}}"


@pytest.fixture
def stranger(tmp_path):
    """The planar arm as a file, on a box that reaches 30 cm below z = 0."""
    foot = '<visual><origin xyz="0 0 0.1"/><geometry><box size="0.3 0.3 0.8"/></geometry></visual>'
    (tmp_path / "mine.urdf").write_text(PLANAR.replace('<link name="base">', f'<link name="base">{foot}'))
    return tmp_path / "mine.urdf"


def test_regions_of_all_kinds(tmp_path, planar):
    regions = (
        "{plane: {normal: [0, 0, 1], offset: 0.1}}",
        "{box: {lower: [0, 0, 0], upper: [1, 1, 1]}}",
        BALL,
        "{cylinder: {lower: [1, 0, 0], upper: [1, 0, 1], radius: 0.1}}",
        tetrahedron(tmp_path / "wedge.obj"),
    )
    plane, box, ball, rod, wedge = workspace(*regions).shapes(planar)
    assert plane == Plane((0.0, 0.0, 1.0), 0.1) and tuple(box.upper) == (1, 1, 1)
    assert isinstance(ball, Sphere) and ball.radius == 0.1 and isinstance(rod, Convex)
    np.testing.assert_allclose([rod.points.min(0)[2], rod.points.max(0)[2]], [0, 1], atol=1e-9)
    np.testing.assert_allclose(wedge.points.max(0), [0.1, 0.1, 2.1], atol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-32", "klingon"])
def test_a_mesh_in_an_unknown_encoding_is_not_said_to_have_a_wrong_unit(tmp_path, planar, encoding):
    file = tmp_path / "wedge.dae"
    file.write_text(f'<?xml version="1.0" encoding="{encoding}"?><COLLADA/>')
    with refused(ConfigError, "wedge.dae", "cannot be read"):
        workspace(f"{{mesh: {{file: {file}}}}}").shapes(planar)


def test_a_mesh_is_stamped_by_its_content(tmp_path, planar):
    texts = [tetrahedron(tmp_path / f"{name}.obj", scale) for name, scale in zip("abc", (1.0, 1.0, 2.0))]
    first, same, other = (workspace(text).stamped(planar) for text in texts)
    assert first == same != other


def test_stamps_of_built_in_workspaces_are_unchanged(planar):
    assert tiny("workspace=desk").workspace.stamped(planar) == {"torque": True, "regions": [DESK]}
    assert tiny("workspace=free").workspace.stamped(planar) == {"torque": True, "regions": []}


def test_a_user_arm_gets_the_floor_that_it_stands_on(context, stranger, caplog):
    made = context("workspace=desk", f"robot.name={stranger}")
    assert made.cell.constraints.regions == (Plane((0.0, 0.0, 1.0), -0.3),)
    with caplog.at_level(logging.INFO):
        made.log_decisions()
    assert "floor at z = -0.3 m, which planar2 stands on; workspace=free removes it" in caplog.text
    assert context("workspace=free", f"robot.name={stranger}").cell.constraints.regions == ()


def test_a_suggested_floor_keeps_the_regions_given(tmp_path):
    (tmp_path / "mine.urdf").write_text(PLANAR)
    note = workspace(BALL, choice="desk").notes(load_robot(tmp_path / "mine.urdf"))
    assert "offset: 0.4}}, {sphere: {centre: [2, 0, 0], radius: 0.1}}]" in note


def test_a_height_of_the_desk_that_does_not_count_is_told(stranger, planar):
    place = replace(workspace(choice="desk"), desk=-0.5)
    assert "workspace.desk of -0.5 m is for" in place.notes(load_robot(stranger))
    assert place.notes(planar) == "" and "workspace.desk" not in workspace(choice="desk").notes(
        load_robot(stranger)
    )


def test_obstacles_keep_the_default_floor_and_a_given_floor_replaces_it(stranger, planar):
    arm, obstacle = load_robot(stranger), workspace(BALL, choice="desk")
    floor, sphere = obstacle.shapes(arm)
    assert floor == Plane((0.0, 0.0, 1.0), -0.3) and isinstance(sphere, Sphere)
    assert "workspace=free removes it" in obstacle.notes(arm)
    assert len(workspace("{plane: {normal: [1, 0, 0], offset: -3}}", choice="desk").shapes(arm)) == 2
    own = workspace("{plane: {normal: [0, 0, 1], offset: -1}}", BALL, choice="desk")
    assert own.shapes(arm)[0].offset == -1 and len(own.shapes(arm)) == 2 and own.notes(arm) == ""
    alone = workspace(BALL)
    assert [type(shape) for shape in alone.shapes(arm)] == [Sphere] and alone.notes(arm) == ""
    assert obstacle.shapes(planar)[0] == Plane((0.0, 0.0, 1.0), 0.1)


@pytest.mark.parametrize(
    ("mount", "has_floor"), [((0.5, 0, 1), True), ((3.1416, 0, 0), False), ((0, 1.57, 0), False)]
)
def test_a_mounted_arm_has_a_floor_unless_it_hangs(mount, has_floor):
    arm, desk = load_robot("kuka_lwr4", Setup(mount=mount)), tiny("workspace=desk").workspace
    assert bool(desk.shapes(arm)) == has_floor
    assert ("stands on" if has_floor else "does not stand upright") in desk.notes(arm)
