"""Descriptions that are no URDF: MJCF against MuJoCo, xacro files, arms by name; and where meshes are."""

import re
import sys
from dataclasses import replace
from unittest.mock import patch

import mujoco
import numpy as np
import pytest
import trimesh

from sidegan.errors import RobotError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Drives, Limits, Setup, load_robot, possible_links, write_mjcf, write_urdf
from sidegan.robot.meshes import find_mesh
from sidegan.robot.sources import read_source
from sidegan.validity.capsules import place_points
from tests.refusals import refused

from .urdf import one_joint, outside

SPEEDS = Limits(velocity={"one": 1.0, "two": 1.0, "slide": 0.1})
MJCF = """<mujoco model="toy">
<compiler angle="degree"/>
<default><joint range="-90 90"/></default>
<asset><mesh name="box" file="box.obj" scale="0.1 0.2 0.3"/>
  <mesh name="bare" vertex="0 0 0  0.1 0 0  0 0.2 0  0 0 0.3"/></asset>
<worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="a" pos="0 0 0.2" euler="10 20 30">
    <joint name="one" axis="0 1 1" pos="0.1 0 0.05" ref="20" armature="0.1" damping="3" frictionloss="2"/>
    <geom type="mesh" mesh="box" pos="0.1 0.2 0.3" euler="40 50 60"/>
    <body name="b" pos="0.3 0 0">
      <joint name="two" axis="1 0 0" limited="false"/>
      <joint name="slide" type="slide" axis="0 1 0" range="0 0.5" ref="0.1"/>
      <inertial pos="0.1 0.2 0.3" mass="1" fullinertia="0.2 0.3 0.25 0.01 0.02 0.03"/>
      <geom type="mesh" mesh="bare" pos="0.1 0.2 0.3" euler="40 50 60"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/><geom type="sphere" size="0.9" contype="0" conaffinity="0"/>
      <body name="c" pos="0 0 0.1">
        <joint name="left_finger" type="slide" axis="0 1 0" range="0 0.04" ref="0.01"/>
        <inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/></body>
      <body name="d" pos="0 0 0.1"><joint name="right_finger" type="slide" axis="0 1 0" range="0 0.04"/>
        <inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/></body>
    </body>
  </body>
</worldbody>
<equality><joint joint1="right_finger" joint2="left_finger" polycoef="0.01 -1 0 0 0"/></equality>
<actuator><position joint="one" kp="10" forcerange="-87 87"/></actuator>
</mujoco>"""


MOTORS = [  # beside one whose force is limited
    "",
    '<motor joint="two" forcerange="-7 5"/>',
    '<motor joint="two"/>',
    '<motor joint="two" ctrlrange="-3 4" gear="-5"/>',
    '<motor joint="two" ctrlrange="-3 4" gear="5" forcerange="-2 6"/>',
    '<general jointinparent="two" ctrlrange="-3 4" gainprm="5"/>',
    '<motor joint="two" ctrlrange="-3 4" gear="0"/>',
]
RANGES = 'actuatorfrcrange="-100 90"', 'actuatorfrcrange="-30 35"'  # of the joint itself
ACTUATORS = [*(("", more) for more in MOTORS), *((own, more) for own in RANGES for more in MOTORS[2:4])]


@pytest.fixture
def mjcf(tmp_path, tmp_path_factory, monkeypatch):
    monkeypatch.setenv("SIDEGAN_CACHE", str(tmp_path_factory.getbasetemp() / "shapes"))  # that tests share
    trimesh.creation.box(bounds=[(0, 0, 0), (1, 2, 3)]).export(tmp_path / "box.obj")
    (tmp_path / "toy.xml").write_text(MJCF)
    return tmp_path / "toy.xml"


def vertices(model, data, geom):
    """Vertices of a mesh in the world [m], (V, 3)."""
    first, count = (x[model.geom_dataid[geom]] for x in (model.mesh_vertadr, model.mesh_vertnum))
    local = model.mesh_vert[first : first + count]
    return local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def assert_same_extent(arm, q, points, link, model, data, geom):
    """Points of a link's frame reach as far in the world, at positions (J,), as MuJoCo's mesh does [m]."""
    placed = place_points(arm, q.copy()[:, None], points, np.full((len(points),), link))
    for end in (np.min, np.max):
        theirs = end(vertices(model, data, geom), 0)
        np.testing.assert_allclose(end(placed[:, :, 0].T, 0), theirs, atol=1e-6)


class TestMjcf:
    @pytest.mark.parametrize("gravity", ["0 0 -9.81", "9.81 0 0", "1 -3 2"])
    def test_torque_equals_mujocos(self, mjcf, gravity):
        mjcf.write_text(MJCF.replace("<default>", f'<option gravity="{gravity}"/><default>'))
        arm = load_robot(mjcf, Setup(limits=SPEEDS, locked={"left_finger": 0.03}))
        assert arm.joint_names == ("one", "two", "slide")
        model = mujoco.MjModel.from_xml_path(str(mjcf))
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        data, random = mujoco.MjData(model), np.random.default_rng(0)
        states, expected = random.uniform(-1, 1, (3, 40, 3)), []
        for q, dq, ddq in zip(*states):
            data.qpos[:] = [*q, 0.03, 0.01 - (0.03 - 0.01)]
            data.qvel[:], data.qacc[:] = [*dq, 0, 0], [*ddq, 0, 0]
            mujoco.mj_inverse(model, data)
            expected.append(data.qfrc_inverse[:3].copy())
        found = RigidBody(arm).drive_torque(*states) - np.array([2.0, 0.0, 0.0]) * np.sign(states[1])
        bare = load_robot(mjcf, replace(arm.setup, friction=False))
        assert bare.drives is None and bare.digest != arm.digest
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)  # N·m, N
        upright = load_robot(mjcf, replace(arm.setup, mount=(0.0, 0.0, 0.0)))  # before the file's gravity
        assert not any(upright.mount) and not any("mounted" in note for note in upright.notes)

    def test_shapes_are_where_mujoco_has_them(self, mjcf):
        arm = load_robot(mjcf, Setup(limits=SPEEDS))
        model = mujoco.MjModel.from_xml_path(str(mjcf))
        data, q = mujoco.MjData(model), np.array([0.3, -0.4, 0.2])
        data.qpos[:3] = q
        mujoco.mj_kinematics(model, data)
        ends, links = (arm.capsules.a, arm.capsules.b), arm.capsules.link
        a, b = (place_points(arm, q[:, None], x, links)[:, :, 0].T for x in ends)
        hulls, radius, fitted = arm.capsules.hulls, arm.capsules.radius.tolist(), arm.capsules.fitted
        assert (~fitted).sum() == 1
        box, bare = [g for g in range(model.ngeom) if model.geom_dataid[g] >= 0]
        for geom, owner in ((box, "a"), (bare, "b")):  # of bare there is no file: its hull is made one
            rows = [k for k in np.flatnonzero(fitted) if arm.capsules.owners[k] == owner]
            seen = [outside(vertices(model, data, geom), a[k], b[k], radius[k]) for k in rows]
            assert np.min(seen, axis=0).max() <= 1e-6  # the vertices are single precision
            corners = np.concatenate([hulls[k] for k in rows])
            assert_same_extent(arm, q, corners, int(arm.capsules.link[rows[0]]), model, data, geom)

    def test_an_inline_mesh_keeps_its_dent(self, mjcf):
        """A tetrahedron of 1 l, one face of which has a dent that takes away 0.4 of it."""
        corners, dent = "0 0 0  0.1 0 0  0 0.2 0  0 0 0.3", "0.02 0.04 0.06"
        faces = "0 2 1  0 1 3  0 3 2  1 2 4  2 3 4  3 1 4"
        mesh = f'<mesh name="dented" vertex="{corners}  {dent}" face="{faces}"/>'
        body = '<worldbody><geom type="mesh" mesh="dented"/></worldbody>'
        mjcf.write_text(f"<mujoco><asset>{mesh}</asset>{body}</mujoco>")
        file = read_source(mjcf).root.find("link/collision/geometry/mesh").get("filename")
        assert abs(trimesh.load(file).volume) == pytest.approx(0.6e-3, rel=1e-5)

    def test_limits_and_what_is_said_about_what_is_ignored(self, mjcf, caplog):
        missing = "'one' has no velocity limit", "limits={'velocity': {'one': 1, 'two': 1, 'slide': 0.1}}"
        with refused(RobotError, *missing):
            load_robot(mjcf)
        arm = load_robot(mjcf, Setup(limits=SPEEDS))
        assert arm.torque_limit.tolist() == [87, np.inf, np.inf]
        assert arm.position_upper.tolist() == pytest.approx([np.pi / 2, np.pi, 0.5])
        notes = "; ".join(arm.notes)
        assert "left_finger at 0.02 m, right_finger at 0 m" in notes
        assert arm.planes == ((0.0, 0.0, 1.0, 0.0),)
        assert "gravcomp" not in notes
        assert "do not include" not in caplog.text
        text = MJCF.replace('<joint name="two"', '<joint name="two" stiffness="60"')
        text = text.replace("<worldbody>", '<option viscosity="5" gravity="0 0 0"/><worldbody>')
        text = text.replace("-1 0 0 0", '-1 0 0 0" active="false').replace('"b" pos', '"b" gravcomp="1" pos')
        mjcf.write_text(text)
        arm = load_robot(mjcf, Setup(limits=SPEEDS, locked={"left_finger": 0.03}))
        notes = "; ".join(arm.notes)
        assert "right_finger at 0.02 m" in notes and "gravity of b is compensated" in notes
        assert np.linalg.norm(arm.gravity) == pytest.approx(9.81) and "switches gravity off" in notes
        assert "do not include springs (stiffness) at two; drag of the medium" in caplog.text

    def test_a_joint_may_have_the_name_that_one_without_a_name_would_get(self, mjcf):
        mjcf.write_text(MJCF.replace('name="slide"', 'name="joint_1"').replace('name="two" ', ""))
        arm = load_robot(mjcf, Setup(limits=Limits(velocity=1.0)))
        assert arm.joint_names == ("one", "joint_1_", "joint_1")

    @pytest.mark.parametrize(("own", "more"), ACTUATORS)
    def test_torque_limits_are_what_mujocos_actuators_can_give(self, mjcf, own, more):
        """Pushed as hard as can be, both ways: actuators add up, and the joint's own range cuts their sum."""
        motors = f'<motor joint="two" gear="-2" forcerange="-20 25"/>{more}</actuator>'
        text = MJCF.replace("</actuator>", motors).replace('<joint name="two"', f'<joint name="two" {own}')
        mjcf.write_text(text)
        model = mujoco.MjModel.from_xml_path(str(mjcf))
        data, dof, pushed = mujoco.MjData(model), model.joint("two").dofadr[0], []
        for sign in (-1e6, 1e6):
            data.ctrl[:] = sign * np.sign(model.actuator_gear[:, 0])
            mujoco.mj_forward(model, data)
            pushed.append(abs(data.qfrc_actuator[dof]))
        limit = float(load_robot(mjcf, Setup(limits=SPEEDS)).torque_limit[1])
        assert limit == pytest.approx(min(pushed) if min(pushed) < 1e5 else np.inf)

    def test_an_exported_mjcf_has_the_same_neighbours_around_offset_anchors(self, mjcf):
        mjcf.write_text(re.sub('<joint name="slide".*', "", MJCF))
        setup = Setup(limits=Limits(velocity=1.0))
        arm = load_robot(mjcf, setup)
        assert arm.link_names[0] == "a/one" and arm.parents == {("b", "a")}
        write_mjcf(arm, possible_links(arm), mjcf, Drives.none(2))
        (pair,) = load_robot(mjcf, setup).may_touch
        assert {*pair} == {"a", "b", "contact exclude"}


def driven(actuators="", inside="", beside="", **joint):
    """MJCF of an arm of three joints and a finger, and what acts on them."""
    words = " ".join(f'{key}="{value}"' for key, value in joint.items())
    return f"""<mujoco><compiler autolimits="true"/>
<default><joint range="-2 2" axis="0 1 0" actuatorfrcrange="-90 90"/></default><worldbody>
<body name="base"><geom size=".1"/>
  <body name="a" pos="0 0 .2"><joint name="ja" axis="0 0 1"/><geom size=".05"/>
    <body name="b" pos="0 0 .2"><joint name="jb" {words}/><geom size=".05"/>
      <body name="c" pos="0 0 .4"><joint name="jc"/><geom size=".05"/><site name="end" pos="0 0 .1"/>
        <body name="finger" pos="0 .05 .2"><joint name="j_finger" range="0 1"/><geom size=".01"/></body>
        <body name="thumb" pos="0 -.05 .2"><joint name="j_thumb" range="0 1"/><geom size=".01"/></body>
      </body></body>{beside}</body></body>
</worldbody>{inside}<actuator>{actuators}</actuator></mujoco>"""


BAR = '<body name="bar" pos="-.1 0 .2"><joint name="j_bar"/><geom size=".02"/></body>'
BELT = '<tendon><fixed name="belt"><joint joint="jb" coef="1"/><joint joint="jc" coef="1"/></fixed></tendon>'
GRIP = '<tendon><fixed name="grip"><joint joint="j_finger" coef="1"/></fixed></tendon>'
WELD = "<equality><weld body1='{}'/></equality>"
CONNECT = "<equality><connect body1='{}' body2='{}' {}/></equality>"
CURVED = "<equality><joint joint1='{}' joint2='{}' polycoef='0 1 .5 0 0'/></equality>"
STRETCHED = "<equality><tendon tendon1='{}'/></equality>"
ANCHOR, OFF = "anchor='0 0 .4'", "anchor='0 0 .4' active='false'"
FREE = Setup(tip="c", limits=Limits(velocity=1.0))
STRONG = replace(FREE, limits=Limits(velocity=1.0, effort=9.0))
STILL = replace(FREE, locked={"j_bar": 0.0})
TIED = [  # an MJCF, what is said of it, and the setup with which it loads
    (driven('<motor name="m" tendon="belt" ctrlrange="-6 6"/>', BELT), "tendon belt", STRONG),
    (driven('<motor name="m" site="end" ctrlrange="-6 6"/>'), "actuator m", STRONG),
    (driven("", CONNECT.format("bar", "c", ANCHOR), BAR), "equality_0 (bar, c)", STILL),
    (driven("", WELD.format("c")), "ja, jb, jc", None),
    (driven('<motor tendon="belt"/>', BELT), "", FREE),  # its force has no limit
    (driven('<motor tendon="grip" ctrlrange="-6 6"/>', GRIP), "", FREE),
    (driven("", CONNECT.format("finger", "thumb", ANCHOR)), "", FREE),
    (driven("", GRIP + STRETCHED.format("grip")), "", FREE),
    (
        driven("", BELT + STRETCHED.format("belt")),
        "(b, a) ties jb; loop_joint equality_0 (c, b) ties jc",
        None,
    ),
    (driven("", CONNECT.format("bar", "c", OFF), BAR), "", FREE),
    (driven("", CURVED.format("jc", "jb")), "equality_0 (c, b) ties jc", None),
    (driven("", CURVED.format("j_thumb", "j_finger")), "", FREE),
]


@pytest.mark.parametrize(("text", "said", "setup"), TIED)
def test_ties_and_motors_on_several_joints_are_refused_until_the_user_says_more(load, text, said, setup):
    if said:
        with refused(RobotError, said):
            load(text, FREE, name="arm.xml")
    if setup is not None:
        arm = load(text, setup, name="arm.xml")
        assert arm.joint_names == ("ja", "jb", "jc")
        assert arm.torque_limit.tolist() == [9.0 if setup is STRONG else 90.0] * 3


def test_a_ball_joint_is_no_floating_base_and_may_be_locked(load):
    ball = driven(type="ball").replace(
        'type="ball"', 'type="ball" limited="false" actuatorfrclimited="false"'
    )
    with refused(RobotError, "'jb' is ball: a joint must", "locked={'jb': 0}"):
        load(ball, FREE, name="arm.xml")
    assert load(ball, replace(FREE, locked={"jb": 0.0}), name="arm.xml").joint_names == ("ja", "jc")


def test_reading_two_joints_on_one_axis_leaves_no_file_of_mujocos(load, tmp_path, monkeypatch):
    """The inertia matrix is singular, of which MuJoCo warns."""
    monkeypatch.chdir(tmp_path)
    twice = driven().replace('<joint name="jc"/>', '<joint name="jc"/><joint name="jd"/>')
    assert load(twice, FREE, name="arm.xml").joint_names == ("ja", "jb", "jc", "jd")
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_a_torque_limit_that_is_not_read_is_none_where_nothing_is_planned(tmp_path):
    (tmp_path / "arm.xml").write_text(TIED[0][0])
    arm = load_robot(tmp_path / "arm.xml", FREE, planning=False)
    assert arm.torque_limit.tolist() == [90.0, np.inf, np.inf]
    assert not [note for note in arm.notes if "assumed" in note]


def test_a_torque_limit_that_the_file_lacks_and_the_user_gave_is_written(load, tmp_path):
    arm = load(TIED[0][0], STRONG, name="arm.xml")
    write_urdf(arm, arm.inertial_parameters, tmp_path / "out.urdf")
    read = load_robot(tmp_path / "out.urdf", FREE)
    assert read.torque_limit.tolist() == [90.0, 9.0, 9.0]  # and otherwise the file's


LEFT_OUT = [  # tendons, and what is said of them
    (GRIP.replace('"grip"', '"grip" stiffness="5"').replace("j_finger", "jb"), "springs (stiffness) at jb"),
    (GRIP.replace('"grip"', '"grip" stiffness="5"'), ""),
    (BELT.replace('"belt"', '"belt" range="-1 1"'), "range of tendon belt at jb, jc"),
]


@pytest.mark.parametrize(("tendon", "said"), LEFT_OUT)
def test_what_acts_on_the_arm_and_is_left_out_is_named_once(load, caplog, tendon, said):
    load(driven("", tendon), FREE, name="arm.xml")
    warned = [record.getMessage() for record in caplog.records if "do not include" in record.getMessage()]
    assert len(warned) == bool(said) and said in "".join(warned)


XACRO = """<robot name="made" xmlns:xacro="http://www.ros.org/wiki/xacro">
{argument}<xacro:property name="reach" value="$(arg reach)"/>
<link name="base"/><joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
<origin xyz="0 0 ${{2 * reach}}"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint><link name="arm"/></robot>"""


def xacro(argument: str = "", text: str = XACRO):
    def run(folder, **args):
        (folder / "arm.urdf.xacro").write_text(text.format(argument=argument))
        return load_robot(folder / "arm.urdf.xacro", Setup(args=args or None))

    return run


def test_a_xacro_file_is_expanded_with_its_arguments(tmp_path):
    pytest.importorskip("xacrodoc")
    run = xacro('<xacro:arg name="reach" default="0.5"/>')
    assert run(tmp_path).translation[0, 2].item() == 1.0
    assert run(tmp_path, reach="0.25").translation[0, 2].item() == 0.5


@pytest.fixture
def known(tmp_path, monkeypatch):
    """A package robot_descriptions with one arm that is there, and one that cannot be fetched."""
    package = tmp_path / "robot_descriptions"
    package.mkdir()
    (tmp_path / "toy.urdf").write_text(one_joint())
    (package / "__init__.py").touch()
    (package / "toy_description.py").write_text(f"URDF_PATH = {str(tmp_path / 'toy.urdf')!r}\n")
    (package / "far_description.py").write_text("raise ConnectionError('no route to host')\n")
    with patch.dict(sys.modules):
        for name in [name for name in sys.modules if name.split(".")[0] == "robot_descriptions"]:
            del sys.modules[name]
        monkeypatch.syspath_prepend(tmp_path)
        yield tmp_path


def test_a_robot_descriptions_name_is_looked_up(known):
    assert load_robot("toy").urdf == load_robot("toy_description").urdf == known / "toy.urdf"


def lost_obj(folder):
    (folder / "toy.xml").write_text(MJCF.replace("box.obj", "gone.obj"))
    return load_robot(folder / "toy.xml")


MACRO = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:macro name="crane" params="prefix parent:=world *origin"><link name="${{prefix}}base"/></xacro:macro>
{argument}</robot>"""
SIZED = """<robot name="made" xmlns:xacro="http://ros.org/wiki/xacro">
<xacro:arg name="size" default=""/><xacro:arg name="sim" default="no"/>
<xacro:include filename="body_$(arg size).xacro"/></robot>"""


def called(folder):
    """A file of macros, beside a file that calls one and another of macros that does."""
    inside = MACRO.replace("crane", "cell").replace("<link", "<xacro:crane/><link")
    (folder / "cell.xacro").write_text(inside.format(argument=""))
    (folder / "top.xacro").write_text(MACRO.format(argument="<xacro:crane/>"))
    return xacro(text=MACRO)(folder)


def usd(folder, content=b"#usda 1.0\n"):
    (folder / "arm.usd").write_bytes(content)
    return load_robot(folder / "arm.usd")


LOST = XACRO.replace("{argument}", '<xacro:include filename="$(find no_such_package)/a.xacro"/>')
REFUSED = {
    "a mesh that is lost": (lost_obj, ["toy.xml", "gone.obj"]),
    "no argument": (xacro(), ["arm.urdf.xacro", "args={'reach': …}"]),
    "only macros": (xacro(text=MACRO), ["arm.urdf.xacro", "crane(prefix, parent:=world, *origin)"]),
    "macros that another file calls": (called, ["arm.urdf.xacro", "/top.xacro"]),
    "no value": (xacro(text=SIZED), ["size (without a value), sim=no", "args={'size': …}"]),
    "USD": (usd, ["arm.usd", "USD"]),
    "binary USD": (lambda at: usd(at, b"PXR-USDC\0"), ["arm.usd", "USD"]),
    "no package": (xacro(text=LOST), ["no_such_package", "ROS_PACKAGE_PATH"]),
    "no xacrodoc": (xacro(), ["sidegan[xacro]"]),
    "an unknown name": (lambda _: load_robot("toi"), ["'toi'", "kuka_lwr4, planar2"]),
    "a far name": (lambda _: load_robot("far"), ["far_description", "no route to host", "robot='arm.urdf'"]),
}


@pytest.mark.parametrize("what", REFUSED)
def test_an_unusable_source_is_refused(known, monkeypatch, what):
    case, names = REFUSED[what]
    if what == "no xacrodoc":
        monkeypatch.setitem(sys.modules, "xacrodoc", None)
    elif what in ("no argument", "no value", "no package") or "macros" in what:
        pytest.importorskip("xacrodoc")
    with refused(RobotError, *names):
        case(known)


OWN, DEEP = "ws/src/arm/meshes/own.stl", "ws/src/vendor/shapes/meshes/deep.stl"
INSTALLED = "share/made/meshes/installed.stl"
FOUND = [
    ("package://arm/meshes/own.stl", OWN),
    ("../meshes/own.stl", OWN),
    ("meshes/own.stl", OWN),
    ("package://renamed/meshes/own.stl", OWN),
    ("model://arm/meshes/own.stl", OWN),
    ("package://shapes/meshes/deep.stl", DEEP),
    ("package://made/meshes/installed.stl", INSTALLED),
    ("meshes/gone.stl", None),
    ("package://", None),
]


@pytest.mark.parametrize(("name", "found"), FOUND)
def test_meshes_are_found_as_ros_users_expect(tmp_path, monkeypatch, name, found):
    """An arm's description in a package, and meshes in others of the same workspace."""
    for mesh in ("ws/src/arm/urdf/arm.urdf", OWN, DEEP, INSTALLED):
        (tmp_path / mesh).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / mesh).touch()
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws/src"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    file = find_mesh(name, tmp_path / "ws/src/arm/urdf/arm.urdf")
    assert file == (None if found is None else (tmp_path / found).resolve())
