"""Each thing that cannot be used is refused with a message that names it."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from sidegan import robot as room
from sidegan.errors import ConfigError, RobotError, ShapeError, StorageError
from sidegan.robot import (
    Drives,
    Limits,
    Setup,
    load_robot,
    torque_of_mjcf,
    torque_of_urdf,
    with_effort,
    write_mjcf,
    write_urdf,
)
from sidegan.robot.meshes import read_mesh
from tests.chains import random_chain, real_links
from tests.refusals import refused

from .test_part import PERSON
from .urdf import collision, joint, limit, link, mesh, more, one_joint, robot, two_joints


def shape(words: str) -> str:
    return one_joint(collision=collision(words))


def part(**setup):
    return lambda at: at.load(PERSON, Setup(**setup))


def stated(**given):
    return lambda at: at.load(two_joints(), Setup(limits=Limits(**given)))


def given(**words):
    return lambda at: load_robot("planar2", **words)


def body(*parameters: float):
    links = np.array([ROD, parameters], dtype=float)
    return lambda at: room.require_consistent(random_chain(2, 0)[0], links)


def written(write, name: str, scale: float = 1.0):
    """Writing the planar arm with scaled inertias."""
    links = scale * load_robot("planar2").inertial_parameters
    return lambda at: write(at.planar, links, at.folder / name, Drives.none(2))


def with_drives(write, *given):
    drives = Drives(*given)
    return lambda at: write(at.planar, at.planar.inertial_parameters, at.folder / "out.xml", drives)


def at_states(read, *states):
    """Torques of a file of the planar arm, in a folder of its own."""

    def run(at):
        write = write_urdf if read is torque_of_urdf else write_mjcf
        write(at.planar, at.planar.inertial_parameters, at.folder / "arm", drives=Drives.none(2))
        read(at.folder / "arm", *([at.planar] if read is torque_of_urdf else []), *states)

    return run


def rewritten(text: str | None):
    """Writing an arm whose description has become another one, or none."""

    def run(at):
        arm = at.load(one_joint())
        arm.urdf.unlink() if text is None else arm.urdf.write_text(text)
        write_urdf(arm, real_links(1, 0), at.folder / "out.urdf")

    return run


def open_mesh(at):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    file = at.folder / "three.stl"
    trimesh.Trimesh(points, [[0, 2, 1], [0, 1, 3], [0, 3, 2]], process=False).export(file)
    read_mesh(file)


ROD = (2.0, 0.0, 0.0, 0.4, 0.1, 0.0, 0.1, 0.0, 0.0, 0.002)
HANDS = joint("left", "base", "thumb") + link("thumb") + joint("right", "base", "finger") + link("finger")
TWO_ARMS = robot(HANDS + link("base", ""))
LOOP = more(two_joints(), joint("third", "base", "upper"))
RING = robot(joint("a", "x", "y"), joint("b", "y", "x"), link("x"), link("y"))
ELSEWHERE = one_joint(origin='xyz="9 9 9" rpy="0.4 -0.5 0.6"')
NO_MASS = '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
TWO, THREE, STATES = np.zeros(2), np.zeros(3), np.zeros((3, 2))

# Descriptions, or what is done at a place, and the names and numbers that the refusal is about.
DEGREES = {"first": (-80.0, 80.0), "second": (-1.0, 1.0)}
REFUSED = {
    RobotError: [
        ("<robot name='cut", ()),
        ("<?xml version='1.0' encoding='klingon'?><robot/>", ()),
        ("<sdf/>", ("<sdf>",)),
        (one_joint().replace("<robot", '<robot version="9"'), ("version",)),
        (lambda at: load_robot(at.folder / "gone.urdf"), ("gone.urdf",)),
        (lambda at: load_robot(at.folder), ("folder",)),
        (lambda at: load_robot("a" * 5000 + ".urdf"), ("aaa.urdf",)),
        (lambda at: load_robot("~nobody_of_that_name/a.urdf"), ("nobody_of_that_name",)),
        (lambda at: load_robot(at.folder / "a\0b.urdf"), ("a\0b.urdf",)),
        # The tree of links and joints.
        (one_joint(kind="fixed"), ()),
        (one_joint(kind="planar"), ("'turn'", "planar")),
        (one_joint(kind="hinge"), ("'turn'", "'hinge'")),
        (TWO_ARMS, ("'left'", "'right'", "tip='thumb'", "tip='finger'")),
        (more(RING, link("base")), ("'base'", "x, y")),
        (LOOP, ("'third'", "'upper'")),
        (more(one_joint(), link("lost")), ("'base', 'lost'",)),
        (RING, ("loop",)),
        (two_joints().replace('"second"', '"first"'), ("2 joints", "'first'")),
        (one_joint().replace('child link="arm"', 'child link="leg"'), ("'turn'", "'leg'")),
        (one_joint().replace('<child link="arm"/>', ""), ("'turn'", "<child>")),
        (one_joint().replace('<link name="arm"', "<link"), ("<link>", "'name'")),
        # Numbers.
        (two_joints(limit=""), ("'second'", "<limit lower upper>")),
        (one_joint(limit=limit(1, 1)), ("'turn'", "1 to 1", "limits={'position': {'turn': ")),
        (one_joint(limit='<limit lower="-1" upper="1"/>'), ("'turn'", "limits={'velocity': {'turn': 1}}")),
        (one_joint(limit=limit(effort=-7)), ("'turn'", "-7", "limits={'effort': {'turn': 7}}")),
        (one_joint(limit=limit(upper="inf")), ("<limit upper='inf'>",)),
        (one_joint(origin='xyz="0 nan 0"'), ("<origin xyz='0 nan 0'>",)),
        (one_joint(origin='xyz="0 1"'), ("<origin xyz='0 1'>",)),
        (one_joint(axis="0 0 0"), ("'turn'", "0 0 0")),
        (one_joint().replace('<axis xyz="0 0 1"/>', "<axis/>"), ("'turn'", "<axis>", "'xyz'")),
        (one_joint(axis="0 0 1e200"), ("0 0 1e200",)),
        (two_joints(origin='xyz="0 0 360"'), ("360 m",)),
        # Shapes.
        (shape(""), ("'arm'",)),
        (shape("<torus/>"), ("'arm'", "torus")),
        (shape('<sphere radius="0"/>'), ("'arm'", "<sphere radius='0'>")),
        (shape("<mesh/>"), ("'arm'", "'filename'")),
        (lambda at: at.load(one_joint(collision=mesh("no_mesh.stl"))), ("no_mesh.stl",)),
        # Which part is the arm, and what is said beside the description.
        (part(tip="hand"), ("'hand'", "tip='")),
        (part(tip="floor"), ("'floor'", "tip")),
        (part(tip="torso", locked={"waist": 0.0}), ("locked",)),
        (part(locked={"glue": 0.0}), ("'glue'", "locked")),
        (part(locked={"right_elbo": 0.0}), ("'right_elbo'", "right_elbow")),
        (part(locked={"waist": 7.0}), ("'waist'", "-1.5 to 2", "locked={'waist': 2}")),
        (stated(velocity={"elbow": 1.0}), ("'elbow'", "limits.velocity")),
        (stated(position=DEGREES), ("first", "80", "{'first': [-1.39626, 1.39626], 'second': [-1, 1]}")),
        (lambda at: at.load(two_joints(), Setup(mount=(180.0, 0.0, 0.0))), ("mount=[3.14159, 0, 0]",)),
        (stated(position={"first": (1.0, 0.0)}), ("'first'", "limits.position", "1 to 0")),
        # Links that cannot exist.
        (body(0.0, *ROD[1:]), ("'joint2'", "0 kg")),
        (body(2.0, 0.0, 0.0, 1.0, *ROD[4:]), ("'joint2'", "(0, 0, 0.5) m")),
        (body(*ROD[:4], -0.1, *ROD[5:]), ("'joint2'", "-0.1")),
        (body(1, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.3), ("'joint2'", "0.3")),
        (body(float("nan"), *ROD[1:]), ("'joint2'",)),
        (lambda at: room.require_consistent(at.load(one_joint(NO_MASS))), ("'arm'", "0 kg")),
        (written(write_urdf, "out.urdf", -1.0), ("'upper_arm'", "-3 kg")),
        (written(write_mjcf, "out.xml", -1.0), ("'upper_arm'", "-3 kg")),
        (written(write_mjcf, "out.xml", 1e-20), ("MuJoCo", "planar2")),
        (lambda at: torque_of_mjcf(at.folder / "gone.xml", STATES, STATES, STATES), ("MuJoCo", "gone.xml")),
        # Descriptions that changed since they were read.
        (rewritten(two_joints()), ("small", "joints")),
        (rewritten(ELSEWHERE), ("small", "translation")),
        (rewritten(None), ("small", "robot.urdf")),
    ],
    ShapeError: [
        (lambda at: room.inconsistent_links(at.planar, np.ones((1, 2, 10))), ("(1, 2, 10)", "(2, 10)")),
        (lambda at: write_urdf(at.planar, np.ones((3, 10)), at.folder / "out"), ("(3, 10)", "(2, 10)")),
        (lambda at: Drives(TWO, THREE, TWO), ("(2,), (3,)",)),
        *((with_drives(write, [1.0], [1.0], [1.0]), ("2",)) for write in (write_urdf, write_mjcf)),
        *((with_drives(write, [1, 2], [1, 2], [1, np.nan]), ("nan",)) for write in (write_urdf, write_mjcf)),
        *((at_states(read, TWO, TWO, TWO), ("(2,)",)) for read in (torque_of_urdf, torque_of_mjcf)),
        *(
            (at_states(read, STATES, STATES, STATES[1:]), ("(2, 2)",))
            for read in (torque_of_urdf, torque_of_mjcf)
        ),
        (given(home=[0.5]), ("home", "0.5", "2")),
        (given(home=[0.5, np.nan]), ("home", "nan")),
        (given(home=["a", "b"]), ("home",)),
    ],
    StorageError: [
        (written(write_urdf, "file/out.urdf"), ("out.urdf",)),
        (written(write_mjcf, "file/arm.xml"), ("arm.xml",)),
    ],
    ConfigError: [
        (open_mesh, ("three.stl",)),
        (lambda at: load_robot(3), ("robot", "3")),
        *(
            (lambda at, share=share: with_effort(at.planar, share), ("effort",))
            for share in (0, 80, np.nan, "x")
        ),
        (given(setup={"tipp": "arm"}), ("tipp", "tip")),
        (given(setup=Setup(mount=(0.0, 0.0))), ("mount",)),
        (given(setup=Setup(limits=Limits(velocity=np.nan))), ("limits.velocity", "nan")),
        (given(setup=Setup(limits=Limits(position={"elbow": 1.0}))), ("limits.position.elbow",)),
    ],
}
NO_JOINTS = one_joint(kind="fixed")


def test_a_joint_of_a_description_without_movable_ones_is_refused_without_suggestions(load):
    with refused(RobotError, "'elbow'") as caught:
        load(NO_JOINTS, Setup(locked={"elbow": 0.0}))
    assert "expected" not in str(caught.value)


CASES = [(error, case, names) for error, cases in REFUSED.items() for case, names in cases]


@pytest.mark.parametrize(("error", "case", "names"), CASES, ids=[" ".join(names) for *_, names in CASES])
def test_is_refused(error, case, names, load, planar, tmp_path, capfd):
    for name in ("file", "no_mesh.stl"):
        (tmp_path / name).touch()
    if isinstance(case, str):
        with refused(error, "robot.urdf", *names):
            load(case)
    else:
        with refused(error, *names):
            case(SimpleNamespace(load=load, folder=tmp_path, planar=planar))
    assert capfd.readouterr() == ("", "")
    assert not [*tmp_path.glob("out*")]  # nothing is left behind
