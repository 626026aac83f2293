"""What surrounds an arm: every kind of region, scenes, and the floor under arms of strangers."""

import logging
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sidegan.errors import ConfigError, InfeasibleError
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from sidegan.pipeline.workspace import Region, Workspace
from sidegan.robot import load_robot
from sidegan.robot.load import _MODELS
from sidegan.validity import Convex, Plane, Sphere
from sidegan.validity.floor import floor_under
from tests.tiny import tiny

SCENE = "(noname)+++\n* ball\n1\nsphere\n0.1\n0.9 0 0.2\n0 0 0 1\n0 0 0 0\n.\n"
DESK = {"plane": {"normal": (0.0, 0.0, 1.0), "offset": 0.1}, "box": None}


def tetrahedron(path: Path, corners: np.ndarray) -> Path:
    """An OBJ file of four corners."""
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def stranger(tmp_path):
    """The planar arm as a file, on a box that reaches 30 cm below z = 0."""
    text = (_MODELS / "planar2.urdf").read_text()
    foot = '<visual><origin xyz="0 0 0.1"/><geometry><box size="0.3 0.3 0.8"/></geometry></visual>'
    (tmp_path / "mine.urdf").write_text(text.replace('<link name="base">', f'<link name="base">{foot}'))
    return tmp_path / "mine.urdf"


def test_regions_of_all_kinds(tmp_path, planar):
    file = tetrahedron(tmp_path / "wedge.obj", np.vstack([np.zeros(3), np.eye(3)]))
    workspace = tiny(
        "workspace.regions=[{sphere: {centre: [1, 0, 0], radius: 0.2}},"
        "{cylinder: {lower: [1, 0, 0], upper: [1, 0, 1], radius: 0.1}},"
        f"{{mesh: {{file: {file}, position: [0, 0, 2], rpy: [0, 0, 0], scale: 0.1}}}}]"
    ).workspace
    ball, rod, wedge = workspace.shapes(planar)
    assert isinstance(ball, Sphere) and ball.radius == 0.2
    assert isinstance(rod, Convex)
    np.testing.assert_allclose([rod.points.min(0)[2], rod.points.max(0)[2]], [0, 1], atol=1e-9)
    np.testing.assert_allclose(wedge.points.max(0), [0.1, 0.1, 2.1], atol=1e-9)


def test_a_mesh_is_known_by_what_is_in_its_file(tmp_path, planar):
    corners = np.vstack([np.zeros(3), np.eye(3)])
    words = "workspace.regions=[{{mesh: {{file: {}, position: [0, 0, 2], rpy: [0, 0, 0], scale: 1}}}}]"
    one = tiny(words.format(tetrahedron(tmp_path / "a.obj", corners))).workspace
    same = tiny(words.format(tetrahedron(tmp_path / "b.obj", corners))).workspace
    other = tiny(words.format(tetrahedron(tmp_path / "c.obj", 2 * corners))).workspace
    assert one.stamped(planar) == same.stamped(planar) != other.stamped(planar)


def test_a_mesh_that_is_not_convex_is_told(tmp_path, planar, caplog):
    import trimesh

    ring = trimesh.creation.annulus(0.3, 0.5, 0.1)
    ring.export(tmp_path / "ring.stl")
    tiny(f"workspace.regions=[{{mesh: {{file: {tmp_path}/ring.stl}}}}]").workspace.shapes(planar)
    assert "% of its hull, all of which is kept out of" in caplog.text


def test_a_mesh_that_is_none_is_refused(tmp_path, planar):
    (tmp_path / "broken.stl").write_text("no mesh")
    for name in ("broken.stl", "lost.stl"):
        with pytest.raises(ConfigError, match=f"mesh file .*{name} cannot be read"):
            tiny(f"workspace.regions=[{{mesh: {{file: {tmp_path}/{name}}}}}]").workspace.shapes(planar)


def test_a_scene_comes_beside_the_desk(tmp_path, planar):
    (tmp_path / "my.scene").write_text(SCENE)
    workspace = tiny("workspace=desk", f"workspace.scene={tmp_path}/my.scene").workspace
    desk, ball = workspace.shapes(planar)
    assert isinstance(desk, Plane) and isinstance(ball, Sphere)
    stamped = workspace.stamped(planar)
    assert stamped["regions"] == [DESK] and len(stamped["scene"]) == 64


def test_artifacts_of_built_in_arms_are_known_as_ever(planar):
    assert tiny("workspace=desk").workspace.stamped(planar) == {"torque": True, "regions": [DESK]}
    assert tiny("workspace=free").workspace.stamped(planar) == {"torque": True, "regions": []}


def test_an_arm_of_a_stranger_has_the_floor_that_it_stands_on(stranger, tmp_path, caplog):
    task = Task(tiny("workspace=desk", f"robot.name={stranger}"), Store(tmp_path))
    (floor,) = task.constraints.regions
    assert floor == Plane((0.0, 0.0, 1.0), -0.3)
    with caplog.at_level(logging.INFO):
        task.tell_checks()
    assert "floor at z = -0.3 m, which planar2 stands on; workspace=free drops it" in caplog.text
    free = tiny("workspace=free", f"robot.name={stranger}")
    assert Task(free, Store(tmp_path)).constraints.regions == ()


def test_an_obstacle_leaves_the_floor_and_a_floor_of_ones_own_takes_its_place(stranger):
    arm, ball = load_robot(stranger), "{sphere: {centre: [2, 0, 0], radius: 0.1}}"
    obstacle = tiny("workspace=desk", f"workspace.regions=[{ball}]").workspace
    floor, sphere = obstacle.shapes(arm)
    assert floor == Plane((0.0, 0.0, 1.0), -0.3) and isinstance(sphere, Sphere)
    assert "workspace=free drops it" in obstacle.told(arm)
    wall = tiny("workspace=desk", "workspace.regions=[{plane: {normal: [1, 0, 0], offset: -3}}]").workspace
    assert len(wall.shapes(arm)) == 2
    own = tiny(
        "workspace=desk", f"workspace.regions=[{{plane: {{normal: [0, 0, 2], offset: -1}}}}, {ball}]"
    ).workspace
    lower, _ = own.shapes(arm)
    assert lower.offset == -1 and own.told(arm) == ""
    alone = tiny("workspace=free", f"workspace.regions=[{ball}]").workspace
    assert [type(one) for one in alone.shapes(arm)] == [Sphere] and alone.told(arm) == ""
    desk, _ = obstacle.shapes(load_robot("planar2"))
    assert desk == Plane((0.0, 0.0, 1.0), 0.1)


def test_an_arm_that_hangs_has_no_floor(planar, tmp_path):
    text = (_MODELS / "planar2.urdf").read_text()
    text = text.replace('lower="-2.6" upper="2.6"', 'lower="2.4" upper="3.8"')
    text = text.replace('lower="-2.9" upper="2.9"', 'lower="-0.3" upper="0.3"')
    (tmp_path / "hanging.urdf").write_text(text)
    hanging = load_robot(tmp_path / "hanging.urdf")
    assert floor_under(hanging) is None
    assert tiny("workspace=desk").workspace.shapes(hanging) == []
    assert "no floor" in tiny("workspace=desk").workspace.told(hanging)


def test_a_base_without_shape_stands_at_zero(planar):
    capsules = planar.capsules
    bare = replace(
        planar,
        urdf=Path("lost.urdf"),
        capsules=replace(
            capsules,
            link=capsules.link[1:],
            a=capsules.a[1:],
            b=capsules.b[1:],
            radius=capsules.radius[1:],
            names=capsules.names[1:],
        ),
    )
    assert floor_under(bare).offset == 0


def test_a_stated_clearance_is_kept_by_all_that_can_have_it(planar):
    """A link above its foot is never so far from the floor: it merely keeps out of it, and that is told."""
    floor = Region(plane=Plane((0.0, 0.0, 1.0), 0.35))
    constraints = Workspace(torque=True, regions=[floor], clearance=0.2).around(planar)
    assert constraints.kept_clear == "0.2 m (never so far: upper_arm in region 0)"
    home = torch.tensor([[0.0, 0.0]], dtype=torch.float64)
    margins = constraints.at_rest(home)
    above = torch.tensor(["upper_arm" in name for name in constraints.labels["keep_out"]])
    told = torch.cat([margins["collision"][0], margins["keep_out"][0][~above]]).min() + 0.2
    assert float(constraints.nearest(home)) == pytest.approx(float(told))
    assert float(told) > float(margins["keep_out"][0][above].min()) > 0
    with pytest.raises(InfeasibleError, match="cannot be kept") as refused:
        Workspace(torque=True, regions=[floor], clearance=0.6).around(planar)
    offered = float(re.search(r"'workspace\.clearance=([\d.]+)'", str(refused.value)).group(1))
    Workspace(torque=True, regions=[floor], clearance=offered).around(planar)
