"""Descriptions that say things unusually: floors, units, limits, missing files."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from sidegan.errors import RobotError
from sidegan.pipeline.compose import composed
from sidegan.robot import Drives, Limits, Setup, changes, load_robot, possible_links, write_mjcf, write_urdf
from sidegan.robot.fitting import DIRECTIONS
from sidegan.validity import Plane
from sidegan.validity.constraints import Constraints
from sidegan.validity.floor import floor_is_known, floor_under
from tests.pipeline.test_workspace import workspace
from tests.refusals import refused
from tests.robot.test_cases import LIMIT, arm_of, inertial
from tests.robot.urdf import collision, joint, link, mesh, more, robot, visual

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n"


@pytest.fixture
def block(tmp_path):
    """A box of a mesh, from z = 0 to 0.1 m; and a file that stands for one that was not downloaded."""
    box = trimesh.creation.box(bounds=[(-0.1, -0.1, 0), (0.1, 0.1, 0.1)])
    box.export(tmp_path / "block.stl")
    (tmp_path / "pointer.stl").write_text(POINTER)


BOX = collision('<box size="0.2 0.2 0.1"/>', 'xyz="0 0 0.05"')
BALL = collision('<sphere radius="0.12"/>', 'xyz="0 0 0.03"')
LOST, POINTED = visual('<mesh filename="lost.dae"/>'), visual('<mesh filename="pointer.stl"/>')
LOW, DRAWN = mesh("block.stl", 'xyz="0 0 -0.05"'), visual('<box size="0.2 0.2 0.1"/>', 'xyz="0 0 0.05"')
BESIDE = visual('<box size="0.04 0.04 0.04"/>', 'xyz="-0.11 -0.33 -0.03"')
SOCKET = visual('<box size="0.3 0.3 0.1"/>', 'xyz="0 0 -0.05"')
FLOORS = {  # what the base is made of, where it stands [m], and whether that is known
    "a visual that is lost, a box": (LOST + BOX, 0.0, False),
    "a visual that is lost, a ball that reaches below": (LOST + BALL, 0.0, False),
    "a visual that was not downloaded, a mesh": (POINTED + mesh("block.stl"), 0.0, True),
    "a visual above a ball that reaches below": (DRAWN + BALL, 0.0, True),
    "a visual above a mesh": (DRAWN + LOW, 0.0, True),
    "a mesh alone": (LOW, -0.05, True),
    "a plug that hangs beside the foot": (DRAWN + BESIDE, 0.0, True),
    "a socket around the foot": (DRAWN + SOCKET, -0.1, True),
    "a box far below": (collision('<box size="0.2 0.2 0.1"/>', 'xyz="0 0 -0.2"'), -0.25, False),
    "nothing": ("", 0.0, False),
    "a visual in millimetres": (visual('<mesh filename="block.stl" scale="1e3 1e3 1e3"/>') + BOX, 0.0, False),
}


@pytest.mark.parametrize(("base", "height", "known"), FLOORS.values(), ids=FLOORS)
def test_the_floor_height_follows_the_base_or_is_reported_as_a_guess(load, block, base, height, known):
    pillar = link("pillar", visual('<box size="0.1 0.1 0.1"/>', 'xyz="3 0 0.5"'))
    glued = more(arm_of(base=base), joint("glue", "base", "pillar", "fixed", "", limit=""), pillar)
    for text in (arm_of(base=base), glued) if base else (arm_of(base=base),):
        assert floor_under(load(text)).offset == pytest.approx(height)
    arm = load(arm_of(base=base))
    said = workspace(choice="desk").notes(arm)
    assert floor_is_known(arm) == known == ("a guess, since" not in said)
    assert known == (f"'offset': {height:g}" not in said)


def limbs(first, second):
    """URDF of a body with two limbs, of so many joints each."""
    block = BOX + BOX.replace("collision", "visual")
    parts = [link("body", block)]
    for name, side, count in (("left", 0.3, first), ("right", -0.3, second)):
        for k in range(count):
            parent, place = (f"{name}{k - 1}", "0 0 -0.3") if k else ("body", f"0 {side} 0")
            parts.append(joint(f"{name}_j{k}", parent, f"{name}{k}", "revolute", f'xyz="{place}"', "0 1 0"))
            parts.append(link(f"{name}{k}", block))
    return robot(*parts)


@pytest.mark.parametrize(("first", "second", "stands"), [(3, 3, False), (2, 4, True)])
def test_what_another_leg_reaches_is_no_floor_but_legs_are_what_an_arm_stands_on(load, first, second, stands):
    arm = load(limbs(first, second), Setup(tip=f"left{first - 1}"))
    assert (floor_under(arm) is not None) == stands
    assert ("no floor" in workspace(choice="desk").notes(arm)) != stands


def test_a_home_where_links_come_close_that_never_touch_is_feasible(load):
    """Their distance, 8 mm at home, counts though without the clearance they need no check."""
    slide = '<limit lower="0" upper="0.5" velocity="1" effort="50"/>'
    text = robot(
        link("base", collision('<sphere radius="0.05"/>')),
        joint("turn", "base", "arm", "revolute", "", "0 0 1"),
        link("arm"),
        joint("slide", "arm", "hand", "prismatic", 'xyz="0.108 0 0"', "1 0 0", slide),
        link("hand", collision('<sphere radius="0.05"/>')),
    )
    place = replace(workspace(choice="desk"), clearance=None, desk=None)
    constraints = place.around(load(text), (0.0, 0.0))
    constraints.refuse_home((0.0, 0.0))
    assert 0 < constraints.tight[("base", "hand")] < 0.008


MJCF = """<mujoco model="three"><compiler angle="radian" meshdir="meshes"/>{option}{asset}<worldbody>{world}
<body name="foot"><geom type="sphere" size="0.12" pos="0 0 0.03"/>
<geom type="cylinder" size="0.08 0.05" pos="0 0 0.05" contype="0" conaffinity="0"/>
<body name="one" pos="0 0 0.2"><joint name="j1" range="-2.8 2.8"/>{inertial}{geom}
<geom type="capsule" size="0.04 0.1" pos="0 0 0.15"/>
<body name="two" pos="0 0 0.3"><joint name="j2" axis="0 1 0" range="-2.8 2.8" armature="0.1"/>
<inertial mass="1" pos="0 0 0.1" diaginertia="0.01 0.01 0.01"/>
<geom type="capsule" size="0.04 0.1" pos="0 0 0.15"/>
<body name="three" pos="0 0 0.3"><joint name="j3" axis="0 1 0" range="-2.8 2.8"/>
<inertial mass="1" pos="0 0 0.1" diaginertia="0.01 0.01 0.01"/>
<geom type="capsule" size="0.04 0.1" pos="0 0 0.15"/></body></body></body></body></worldbody></mujoco>"""
WEIGHS = '<inertial mass="1" pos="0 0 0.1" diaginertia="0.01 0.01 0.01"/>'
FLAT = '<geom type="plane" size="1 1 1" pos="0 0 {}"/>'
SPEED = Setup(limits=Limits(velocity=1.5))


def mjcf(**parts):
    return MJCF.format(**{"option": "", "asset": "", "world": "", "inertial": WEIGHS, "geom": ""} | parts)


PLANES = {  # what stands in the world beside the arm, gravity, and the planes that are kept out of
    "none": ("", "", [(0, 0, 1, 0.0)], "stands on"),
    "a floor": (FLAT.format(-0.03), "", [(0, 0, 1, -0.03)], "z = -0.03 m, from the description"),
    "a floor above the arm": (FLAT.format(3), "", [(0, 0, 1, 0.0)], "is nearly always behind"),
    "a floor and a wall": (
        FLAT.format(0) + '<geom type="plane" size="1 1 1" pos="-0.7 0 0" zaxis="1 0 0"/>',
        "",
        [(0, 0, 1, 0.0), (1, 0, 0, -0.7)],
        "1 plane of the description",
    ),
    "a wall that it hangs at": (FLAT.format(0), "-9.81 0 0", [(1, 0, 0, 0.0)], "no floor"),
}


@pytest.mark.parametrize(("world", "gravity", "planes", "said"), PLANES.values(), ids=PLANES)
def test_mjcf_planes_become_floor_and_walls(load, world, gravity, planes, said):
    option = f'<option gravity="{gravity}"/>' if gravity else ""
    arm, desk = load(mjcf(world=world, option=option), SPEED, name="a.xml"), workspace(choice="desk")
    found = desk.shapes(arm)
    assert said in desk.notes(arm) and all(isinstance(region, Plane) for region in found)
    if not gravity:
        np.testing.assert_allclose([(*plane.unit, plane.offset) for plane in found], planes, atol=1e-9)
    else:  # what was up is level, and gravity has no part of it
        (wall,) = found
        assert abs(wall.unit[2]) < 1e-9 and abs(wall.offset) < 1e-9
    own = workspace("{plane: {normal: [0, 0, 1], offset: -0.5}}", choice="desk").shapes(arm)
    assert [plane.offset for plane in own if plane.unit[2] > 0.7] == [-0.5]


def box(unit):
    """A Collada file of a box of 200, 100, 50 units, with an element of that unit."""
    made = trimesh.creation.box((200, 100, 50)).export(file_type="dae").decode()
    return made.replace("<up_axis>", f"{unit}<up_axis>")


MILLIMETRES = '<unit name="millimeter" meter="0.001"/>'
UNITS = [(MILLIMETRES, 1e-3), ("", 1.0)]


@pytest.mark.parametrize(("unit", "metres"), UNITS)
def test_mesh_files_are_scaled_by_the_unit_that_they_state(load, tmp_path, unit, metres):
    file = tmp_path / "box.dae"
    file.write_text(box(unit))
    scale = " ".join([str(0.001 / metres)] * 3)
    arm = load(arm_of({1: inertial() + mesh(file.name, 'xyz="0 0 0.15"', scale)}))
    hulls = zip(arm.capsules.owners, arm.capsules.hulls)
    corners = np.concatenate([hull for owner, hull in hulls if owner == "link1"])
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.2, 0.1, 0.05], atol=1e-3)
    if unit == MILLIMETRES:  # and those of obstacles, if nothing else is said of them
        for said, factor in (("", 1.0), (", scale: 0.01", 10.0)):
            (region,) = workspace(f"{{mesh: {{file: {file}{said}}}}}").shapes(arm)
            np.testing.assert_allclose(np.ptp(region.points, axis=0), np.array([0.2, 0.1, 0.05]) * factor)


ORDERS = {"1000 1000 1000": "2.3e+02 m", "0.001 0.001 0.001": "0.00023 m"}  # scales of a mesh of 0.2 m


def test_shapes_of_implausible_size_or_unit_are_refused(load, tmp_path):
    trimesh.creation.box((0.2, 0.1, 0.05)).export(tmp_path / "box.stl")
    for scale, size in ORDERS.items():
        with refused(RobotError, "link1", size, "millimetres"):
            load(arm_of({1: inertial() + mesh("box.stl", scale=scale)}))
    hall = collision('<box size="200 200 0.1"/>', 'xyz="0 0 -0.1"')
    assert load(arm_of(base=hall)).joints == 4  # what stands still may be a floor
    (tmp_path / "box.dae").write_text(box('<unit meter="-1"/>'))
    with refused(RobotError, "box.dae", "'-1'"):
        load(arm_of({1: inertial() + mesh("box.dae")}))


SAFETY = '<safety_controller k_velocity="30" {}/>'
SOFT = {  # what stands beside a range of ±2.8 rad at 2 rad/s, what the range is, and what is said of it
    "": (-2.8, 2.8, ""),
    'k_position="20" soft_lower_limit="-1" soft_upper_limit="1.5"': (
        -1,
        1.5,
        "joint0 -1 to 1.5 rad; for the full range: limits={'position': {'joint0': [-2.8, 2.8]}}",
    ),
    'soft_lower_limit="-9" soft_upper_limit="1.5"': (-2.8, 1.5, "joint0 -2.8 to 1.5 rad;"),
    'soft_lower_limit="0" soft_upper_limit="0"': (-2.8, 2.8, ""),
    'soft_lower_limit="3" soft_upper_limit="4"': (-2.8, 2.8, "leave no range are ignored: joint0"),
}


@pytest.mark.parametrize("given", SOFT)
def test_tighter_soft_limits_apply(load, given):
    lower, upper, said = SOFT[given]
    text = arm_of().replace(LIMIT, LIMIT + SAFETY.format(given), 1)
    arm, wide = load(text), load(text, Setup(limits=Limits(position={"joint0": (-2.0, 2.0)})))
    assert (arm.position_lower[0], arm.position_upper[0]) == (lower, upper)
    assert said in "; ".join(arm.notes) and ("soft" in "; ".join(arm.notes)) == bool(said)
    assert wide.position_upper[0] == 2 and not any("soft" in note for note in wide.notes)


def test_acceleration_and_jerk_limits_are_read_from_a_urdf(load, tmp_path):
    ours = LIMIT.replace("/>", ' drake:acceleration="1.5" jerk="70" deceleration="1.25"/>')
    heads = (
        "<robot",
        '<robot xmlns:drake="http://drake.mit.edu"',
        '<robot xmlns="http://a" xmlns:ns1="http://b"',
    )
    for head in heads:
        arm = load(arm_of(limit=ours).replace("<robot", head, 1))
        assert arm.acceleration_limit.tolist() == [1.25] * 4 and arm.jerk_limit.tolist() == [70] * 4
        assert "joint0, joint1, joint2, joint3 come from the description" in "; ".join(arm.notes)
        write_urdf(arm, arm.inertial_parameters, tmp_path / "out.urdf")
        assert 'drake:acceleration="1.5"' in (tmp_path / "out.urdf").read_text()
        assert np.array_equal(load_robot(tmp_path / "out.urdf").acceleration_limit, arm.acceleration_limit)
    stated = load_robot(arm.urdf, Setup(limits=Limits(acceleration={"joint1": 9.0})))
    assert stated.acceleration_limit.tolist() == [1.25, 9, 1.25, 1.25]


def test_a_single_number_sets_the_limit_of_every_joint(load):
    given = Limits(2.0, 1.5, 3.0, 70.0, 9.0)
    arm = load(arm_of(), Setup(limits=given))
    found = arm.position_upper, arm.velocity_limit, arm.acceleration_limit, arm.jerk_limit, arm.torque_limit
    assert np.stack(found).T.tolist() == [[2.0, 1.5, 3.0, 70.0, 9.0]] * 4
    assert np.array_equal(arm.position_lower, -arm.position_upper)
    assert "robot.limits.velocity=1.5" in changes("robot", Setup(limits=given))
    again = composed("+experiment=excite", "robot.name=a.urdf", *changes("robot", Setup(limits=given)))
    assert again.robot.limits == given


def test_settings_may_be_the_fields_of_a_setup_and_numbers_numpys(load, tmp_path):
    load(arm_of())
    fields = {"locked": {"joint3": np.float64(0.5)}, "limits": {"velocity": np.int64(1)}}
    arm = load_robot(tmp_path / "robot.urdf", fields)
    assert arm.setup == load_robot(tmp_path / "robot.urdf", arm.setup).setup
    assert arm.velocity_limit.tolist() == [1.0] * 3


@pytest.mark.parametrize("encoding", ["klingon", "utf-32"])
def test_an_srdf_in_an_unknown_encoding_gives_no_home(load, tmp_path, encoding):
    (tmp_path / "rods.srdf").write_text(f'<?xml version="1.0" encoding="{encoding}"?><robot name="rods"/>')
    assert load(arm_of()).home is None


JOINTS = {
    "joint0": {"has_velocity_limits": True, "max_velocity": 1.25, "has_jerk_limits": False, "max_jerk": 1},
    "joint1": {"has_acceleration_limits": True, "max_acceleration": 2.5},
    "joint2": {"max_position": 1.0},  # no flag turns it off; the other end is the description's
    "finger": {"has_velocity_limits": True, "max_velocity": 0.1},
}
FILES = {
    "MoveIt's": {"default_velocity_scaling_factor": 0.1, "joint_limits": JOINTS},
    "of a node": {"/**": {"ros__parameters": {"sim": True, "planning": {"joint_limits": JOINTS}}}},
}


@pytest.mark.parametrize("what", FILES)
def test_limits_are_read_from_a_joint_limits_yaml(load, tmp_path, what):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(json.dumps(FILES[what]))
    command = ["+experiment=excite", "robot.name=a.urdf", f"robot.limits={file}"]
    limits = composed(*command).robot.limits
    arm = load(arm_of(), Setup(limits=replace(limits, velocity={"joint3": 0.5})))
    assert arm.velocity_limit.tolist() == [1.25, 2, 2, 0.5] and arm.jerk_limit is None
    described = load(arm_of())
    assert arm.acceleration_limit.tolist() == [np.inf, 2.5, np.inf, np.inf]
    assert arm.position_upper[2] == 1 and arm.position_lower[2] == described.position_lower[2]
    (note,) = arm.notes
    assert f"come from {file}; joints that the description does not have are ignored: finger" in note


BAD = {
    "joint_limits: {finger: {has_jerk_limits: true, max_jerk: 1}}": ["finger"],
    "joint_limits: {joint0: {has_jerk_limits: true, max_jerk: fast}}": ["jerk.joint0", "'fast'"],
    "joint_limits: {joint0: {has_jerk_limits: true, max_jerk: 0}}": ["jerk.joint0", "0"],
    "joint_limits: {joint0: {has_velocity_limits: false, max_velocity: 1}}": [
        "no limit",
        "of joint0",
        "has_",
    ],
    "joint_limits: {joint0: {min_position: 1, max_position: -1}}": ["joint0", "1 to -1"],
    "joint_limits: {joint0: {max_velocity: !degrees [90]}}": ["scalar"],
    "limits: 3": ["joint_limits"],
    "a: [": ["while parsing"],
    "&a {x: *a}": ["joint_limits"],
}


@pytest.mark.parametrize(("text", "names"), BAD.items())
def test_an_invalid_joint_limits_yaml_is_refused(load, tmp_path, text, names):
    (tmp_path / "limits.yaml").write_text(text)
    with refused(RobotError, "limits.yaml", *names):
        load(arm_of(), Setup(limits=Limits(file=str(tmp_path / "limits.yaml"))))


def test_missing_torque_limits_give_one_warning(load, caplog):
    load(arm_of(limit=LIMIT.replace('effort="50"', 'effort="0"')))
    (line,) = [record.message for record in caplog.records if "torque" in record.message]
    assert "limits={'effort': {'joint0': …, 'joint1': …" in line
    caplog.clear()
    assert load(arm_of()).joints == 4 and not caplog.records


ASSET = (
    '<asset><texture name="sky" type="2d" file="sky.png"/><material name="m" texture="sky"/>'
    '<mesh name="look" file="look.obj"/><mesh file="hull.stl"/></asset>'
)
LOOK = '<geom type="mesh" mesh="look" material="m" contype="0" conaffinity="0"/>'
HULL = '<geom type="mesh" mesh="hull"/>'


@pytest.mark.parametrize("pointer", [False, True])
def test_an_mjcf_loads_without_its_mesh_files(load, tmp_path, caplog, pointer):
    (tmp_path / "meshes").mkdir()
    if pointer:
        (tmp_path / "meshes" / "hull.stl").write_text(POINTER)
    arm = load(mjcf(asset=ASSET, geom=LOOK + HULL), SPEED, name="a.xml")
    whole = load(mjcf(), SPEED, name="b.xml")
    assert "not shown, since the mesh files are missing: one" in arm.notes
    assert "collisions of these links may go unnoticed: one (not found: hull.stl" in caplog.text
    assert arm.digest == whole.digest
    with refused(RobotError, "MuJoCo", ".obj"):  # its mass is the link's
        load(mjcf(asset=ASSET, geom=HULL, inertial=""), SPEED, name="c.xml")


def test_links_with_empty_or_missing_meshes_are_reported(load, tmp_path, caplog):
    (tmp_path / "empty.dae").write_text(box("").partition("<library_geo")[0] + "</COLLADA>")
    (tmp_path / "empty.stl").write_text("solid nothing\nendsolid nothing\n")
    arm = load(arm_of({1: mesh("empty.dae"), 2: mesh("empty.stl"), 3: mesh("package://gone/box.stl")}))
    assert {*arm.capsules.owners} == {"base", "link0"}
    said = "a surface in empty.dae, a surface in empty.stl, package://gone/box.stl"
    assert f"unnoticed: link1, link2, link3 (not found: {said};" in caplog.text


def test_xacro_includes_are_relative_to_the_including_file(tmp_path, monkeypatch):
    pytest.importorskip("xacrodoc")
    head, folder = '<robot name="made" xmlns:xacro="http://www.ros.org/wiki/xacro">', tmp_path / "parts"
    folder.mkdir()
    inner = f'{head}<xacro:include filename="deeper.xacro"/></robot>'
    (folder / "macro.xacro").write_text(inner)
    (folder / "deeper.xacro").write_text(arm_of().replace('<robot name="rods">', head))
    (tmp_path / "arm.urdf.xacro").write_text(f'{head}<xacro:include filename="./parts/macro.xacro"/></robot>')
    monkeypatch.chdir(folder)
    assert load_robot(tmp_path / "arm.urdf.xacro").joints == 4


def test_a_urdf_exported_from_an_mjcf_is_complete(load, tmp_path):
    arm = load(mjcf(), SPEED, name="a.xml")
    write_urdf(arm, arm.inertial_parameters, tmp_path / "out.urdf")
    again, text = load_robot(tmp_path / "out.urdf"), (tmp_path / "out.urdf").read_text()
    assert "<capsule" not in text and again.velocity_limit.tolist() == [1.5] * 3
    q = np.random.default_rng(0).random((200, 3)).astype(float) * 5.6 - 2.8
    ours, exported = (Constraints(x).at_rest(q)["collision"].min(1).clip(max=0.02) for x in (arm, again))
    assert (ours < 0).any() and (ours > 0).any()
    np.testing.assert_allclose(ours, exported, rtol=0, atol=2e-4)  # facets


def reach(arm):
    """How far what stands for link 1 reaches in many directions [m], (72,)."""
    pieces = zip(arm.capsules.owners, arm.capsules.hulls, arm.capsules.rounding.tolist())
    each = [(hull @ DIRECTIONS.T).max(0) + rounding for owner, hull, rounding in pieces if owner == "link1"]
    return np.max(each, axis=0)


def test_an_exported_mjcf_collides_like_the_original(load, tmp_path):
    tool = more(
        arm_of({1: inertial() + mesh("ball.stl", 'xyz="0 0 0.15"')}),
        joint("glue", "link3", "tool", "fixed", 'xyz="0 0 0.3"', limit=""),
        link("tool", inertial() + collision('<box size="0.05 0.3 0.05"/>')),
        '<disable_collisions link1="base" link2="link1" reason="by design"/>',
    )
    trimesh.creation.icosphere(4, 0.12).export(tmp_path / "ball.stl")
    arm = load(tool)
    write_mjcf(arm, possible_links(arm), tmp_path / "out.xml", Drives.none(4))
    again = load_robot(tmp_path / "out.xml", SPEED)
    before, after = (Constraints(x) for x in (arm, again))
    assert set(before.owners) == set(after.owners) and len(after.link_pairs.named) == 1
    assert (reach(again) >= reach(arm) - 1e-6).all()  # single precision
    assert arm.capsules.rounding.max() > 1e-4
    q = np.random.default_rng(0).random((400, 4)).astype(float) * 5 - 2.5
    ours, exported = (x.at_rest(q)["collision"].min(1) < 0 for x in (before, after))
    assert ours.any() and not ours.all()
    assert (ours <= exported).all() and (ours != exported).astype(float).mean() < 0.03
