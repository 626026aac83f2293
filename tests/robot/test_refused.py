"""Each thing that cannot be used is refused with a message that names it and says what was expected."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from sidegan import robot as room
from sidegan.errors import ConfigError, RobotError, ShapeError, StorageError
from sidegan.robot import Drives, Limits, Setup, load_robot, write_mjcf, write_urdf
from sidegan.robot.meshes import read_mesh
from tests.chains import random_chain, real_links

from .test_part import PERSON
from .urdf import collision, joint, link, mesh, more, one_joint, robot, two_joints


def limits(**values: str) -> str:
    """A joint with other limits; an empty one is left out."""
    stated = {"lower": "-1", "upper": "1", "velocity": "2", "effort": "3"} | values
    words = (f'{key}="{value}"' for key, value in stated.items() if value)
    return one_joint(limit=f"<limit {' '.join(words)}/>")


def shape(words: str) -> str:
    return one_joint(collision=collision(words))


def part(**setup):
    return lambda at: at.load(PERSON, Setup(**setup))


def stated(**given):
    return lambda at: at.load(two_joints(), Setup(limits=Limits(**given)))


def body(*parameters: float):
    links = np.array([ROD, parameters], dtype=float)
    return lambda at: room.require_consistent(random_chain(2, 0)[0], links)


def written(write, name: str, scale: float = 1.0):
    """Writing the planar arm with scaled inertias."""
    links = scale * load_robot("planar2").inertial_parameters
    return lambda at: write(at.planar, links, at.folder / name, Drives.none(2))


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
TWO, THREE = np.zeros(2), np.zeros(3)

# Descriptions, or what is done at a place, and words of the refusal; "…" for whatever stands between them.
DEGREES = {"first": (-80.0, 80.0), "second": (-1.0, 1.0)}
RADIANS = "of first (up to 80) … are these degrees? … {first: [-1.39626, 1.39626], second: [-1, 1]}'"

REFUSED = {
    RobotError: [
        ("<robot name='cut", "is not well-formed XML: unclosed token"),
        ("<?xml version='1.0' encoding='klingon'?><robot/>", "is not well-formed XML"),
        ("<sdf/>", "root element is <sdf>, expected <robot> or <mujoco>"),
        (one_joint().replace("<robot", '<robot version="9"'), "robot.urdf: Pinocchio refuses it: … version"),
        (lambda at: load_robot(at.folder / "gone.urdf"), "no URDF file … gone.urdf"),
        (lambda at: load_robot(at.folder), "is a folder, expected a URDF file"),
        (lambda at: load_robot("a" * 5000 + ".urdf"), "cannot look for"),
        (lambda at: load_robot("~nobody_of_that_name/a.urdf"), "Could not determine home directory"),
        (lambda at: load_robot(at.folder / "a\0b.urdf"), "there is no URDF file"),
        # The tree of links and joints.
        (one_joint(kind="fixed"), "has no movable joints"),
        (one_joint(kind="planar"), "joint 'turn' is planar"),
        (one_joint(kind="hinge"), "of type 'hinge', expected revolute, prismatic, cont"),
        (TWO_ARMS, "joints 'left' and 'right' both branch off the base, expected one chain"),
        (more(RING, link("base")), "no joints connect 'base' to x, y, expected one tree"),
        (LOOP, "joint 'third' is a second joint with child link 'upper'"),
        (more(one_joint(), link("lost")), "has 2 links without a parent ['base', 'lost'], expected only"),
        (RING, "has 0 links without a parent [], expected only the base"),
        (two_joints().replace('"second"', '"first"'), "has 2 joints named 'first', expected unique"),
        (one_joint().replace('child link="arm"', 'child link="leg"'), "refers to link 'leg'"),
        (one_joint().replace('<child link="arm"/>', ""), "joint 'turn': <joint> has no <child>"),
        (one_joint().replace('<link name="arm"', "<link"), "<link> has no 'name'"),
        # Numbers.
        (two_joints(limit=""), "joint 'second' has no position limits"),
        (limits(lower="1"), "position limits 1 to 1, expected lower < upper"),
        (limits(velocity=""), "velocity limit None, expected more than 0"),
        (limits(effort="-7"), "effort limit -7, expected more than 0"),
        (limits(upper="inf"), "<limit upper='inf'>, expected a finite number"),
        (one_joint(origin='xyz="0 nan 0"'), "<origin xyz='0 nan 0'>, expected 3 finite numbers"),
        (one_joint(origin='xyz="0 1"'), "<origin xyz='0 1'>, expected 3 finite numbers"),
        (one_joint(axis="0 0 0"), "has the axis 0 0 0, expected a direction"),
        (one_joint(axis="0 0 1e200"), "expected 3 finite numbers of at most 1e+18"),
        (two_joints(origin='xyz="0 0 360"'), "the links are 360 m long together: are these millimetres?"),
        # Shapes.
        (shape(""), "collision geometry of none, expected one of sphere"),
        (shape("<torus/>"), "collision geometry of torus, expected one of sphere, cylinder"),
        (shape('<sphere radius="0"/>'), "<sphere radius='0'>, expected more than 0"),
        (shape("<mesh/>"), "link 'arm': <mesh> has no 'filename'"),
        (lambda at: at.load(one_joint(collision=mesh("no_mesh.stl"))), "no_mesh.stl"),
        # Which part is the arm, and what is said beside the description.
        (part(tip="hand"), "has no link 'hand', expected for example robot.tip="),
        (part(tip="torso", locked={"waist": 0.0}), "no movable joints that are not locked"),
        (part(locked={"glue": 0.0}), "no joint 'glue'"),
        (part(locked={"right_elbo": 0.0}), "no joint 'right_elbo' … for example right_elbow"),
        (part(locked={"waist": 7.0}), "at 7, outside its range -1.5 to 2; … 'robot.locked={waist: 2}'"),
        (stated(velocity={"elbow": 1.0}), "no joint 'elbow' of robot.limits.velocity"),
        (stated(position=DEGREES), RADIANS),
        (
            lambda at: at.load(two_joints(), Setup(mount=(180.0, 0.0, 0.0))),
            "are these degrees? … 'robot.mount=[3.14159, 0, 0]'",
        ),
        (stated(position={"first": (1.0, 0.0)}), "limits.position is 1 to 0, expected lower < upper"),
        # Links that cannot exist.
        (body(0.0, *ROD[1:]), "link 'joint2': its mass is 0 kg"),
        (body(2.0, 0.0, 0.0, 1.0, *ROD[4:]), "joint2 … centre of mass (0, 0, 0.5) m is too far out"),
        (body(*ROD[:4], -0.1, *ROD[5:]), "about the centre of mass, expected more than 0"),
        (body(1, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.3), "the largest exceeds the sum of the others"),
        (body(float("nan"), *ROD[1:]), "not finite"),
        (lambda at: room.require_consistent(at.load(one_joint(NO_MASS))), "link 'arm': its mass is 0 kg"),
        (written(write_urdf, "out.urdf", -1.0), "link 'upper_arm': its mass is -3 kg"),
        (written(write_mjcf, "out.xml", -1.0), "not physically consistent"),
        (written(write_mjcf, "out.xml", 1e-20), "MuJoCo refuses planar2"),
        # Descriptions that changed since they were read.
        (rewritten(two_joints()), "no longer the description of small"),
        (rewritten(ELSEWHERE), "does not read as small: different translation"),
        (rewritten(None), "has no description to start from"),
    ],
    ShapeError: [
        (lambda at: room.inconsistent_links(at.planar, np.ones((1, 2, 10))), "expected (2, 10)"),
        (lambda at: write_urdf(at.planar, np.ones((3, 10)), at.folder / "out"), "(3, 10), expected (2, 10)"),
        (lambda at: Drives(TWO, THREE, TWO), "one number per joint"),
    ],
    StorageError: [
        (written(write_urdf, "file/out.urdf"), "cannot write"),
        (written(write_mjcf, "file/arm.xml"), "cannot write"),
    ],
    ConfigError: [(open_mesh, "three.stl cannot be read: it has no closed surface")],
}
CASES = [(error, case, words) for error, cases in REFUSED.items() for case, words in cases]


@pytest.mark.parametrize(("error", "case", "words"), CASES, ids=[words for *_, words in CASES])
def test_is_refused(error, case, words, load, planar, tmp_path, capfd):
    for name in ("file", "no_mesh.stl"):
        (tmp_path / name).touch()
    pattern = ".*".join(map(re.escape, words.split(" … ")))
    with pytest.raises(error, match=f"(?s){pattern}") as caught:
        load(case) if isinstance(case, str) else case(
            SimpleNamespace(load=load, folder=tmp_path, planar=planar)
        )
    if isinstance(case, str):
        assert "robot.urdf" in str(caught.value)
    assert capfd.readouterr() == ("", "")
    assert not [*tmp_path.glob("out*")]  # nothing is left behind
