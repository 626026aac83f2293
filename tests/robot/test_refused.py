"""Each thing that cannot be used is refused with a message that names it and says what was expected."""

import re
from pathlib import Path

import pytest

from sidegan.errors import RobotError
from sidegan.robot import Setup, load_robot

from .urdf import INERTIA, LIMIT, joint, link, one_joint, robot, two_joints


def limits(**values: str) -> str:
    stated = {"lower": "-1", "upper": "1", "velocity": "2", "effort": "3"} | values
    return "<limit " + " ".join(f'{key}="{value}"' for key, value in stated.items() if value) + "/>"


def shape(words: str) -> str:
    return one_joint(collision=f"<collision><geometry>{words}</geometry></collision>")


TWO_HANDS = robot(
    link("base", ""),
    joint("first", "base", "lower"),
    link("lower"),
    joint("left", "lower", "thumb"),
    link("thumb"),
    joint("right", "lower", "finger"),
    link("finger"),
)
LOOP = two_joints().replace("</robot>", joint("third", "base", "upper") + "</robot>")
RING = robot(joint("a", "x", "y"), joint("b", "y", "x"), link("x"), link("y"))
TWO_BASES = one_joint().replace("</robot>", link("lost") + "</robot>")
BOMB = '<!DOCTYPE bomb [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>' + one_joint()
THIEF = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="&x;"/>'

LONG = robot(
    link("0", ""),
    *(joint(f"j{k}", str(k - 1), str(k), kind="fixed", limit="") + link(str(k), "") for k in range(1, 6001)),
)

SNAKE = robot(
    link("0", ""),
    *(joint(f"j{k}", str(k - 1), str(k)) + link(str(k)) for k in range(1, 34)),
)

REFUSED = {
    "not XML": ("<robot name='cut", "is not well-formed XML: unclosed token"),
    "empty": ("", "is not well-formed XML"),
    "an unknown encoding": ("<?xml version='1.0' encoding='klingon'?><robot/>", "is not well-formed XML"),
    "not a URDF": ("<sdf/>", "root element is <sdf>, expected <robot> or <mujoco>"),
    "a document type": (BOMB, "declares a document type (bomb), expected plain XML"),
    "an external entity": (THIEF, "declares a document type (r)"),
    "no links": (robot(), "has 0 links without a parent [], expected one"),
    "no joints": (robot(link("base")), "has no joints that move"),
    "only fixed joints": (one_joint(kind="fixed"), "has no joints that move"),
    "floating": (one_joint(kind="floating"), "joint 'turn' is floating: the arm's base must be fixed"),
    "planar": (one_joint(kind="planar"), "joint 'turn' is planar"),
    "an unknown joint": (one_joint(kind="hinge"), "of type 'hinge', expected revolute, prismatic, cont"),
    "mimic": (two_joints(extra='<mimic joint="first"/>'), "joint 'second' mimics another"),
    "no limits": (two_joints(limit=""), "joint 'second' has no position limits"),
    "no position limits": (one_joint(limit=limits(lower="", upper="")), "has no position limits"),
    "equal limits": (one_joint(limit=limits(lower="1")), "position limits 1 to 1, expected lower < upper"),
    "swapped limits": (one_joint(limit=limits(lower="2")), "position limits 2 to 1, expected lower < upper"),
    "no velocity limit": (one_joint(limit=limits(velocity="")), "velocity limit None, expected one above 0"),
    "zero velocity": (one_joint(limit=limits(velocity="0.0")), "velocity limit 0.0, expected one above 0"),
    "negative velocity": (one_joint(limit=limits(velocity="-1")), "velocity limit -1, expected one above 0"),
    "negative effort": (one_joint(limit=limits(effort="-7")), "effort limit -7, expected one above 0"),
    "infinite limit": (one_joint(limit=limits(upper="inf")), "<limit upper='inf'>, expected a finite number"),
    "NaN effort": (one_joint(limit=limits(effort="nan")), "<limit effort='nan'>, expected a finite number"),
    "a word for a limit": (
        one_joint(limit=limits(upper="${pi}")),
        "<limit upper='${pi}'>, expected a finite",
    ),
    "NaN origin": (one_joint(origin='xyz="0 nan 0"'), "<origin xyz='0 nan 0'>, expected 3 finite numbers"),
    "short origin": (one_joint(origin='xyz="0 1"'), "<origin xyz='0 1'>, expected 3 finite numbers"),
    "infinite turn": (one_joint(kind="fixed", origin='rpy="inf 0 0"'), "<origin rpy='inf 0 0'>"),
    "no axis": (one_joint(axis='<axis xyz="0 0 0"/>'), "has the axis 0 0 0, expected a direction"),
    "a vanishing axis": (
        one_joint(axis='<axis xyz="0 0 1e-200"/>'),
        "has the axis 0 0 1e-200, expected a dir",
    ),
    "an endless axis": (
        one_joint(axis='<axis xyz="0 0 1e17"/>'),
        "has the axis 0 0 1e+17, expected a direction",
    ),
    "an overflow": (one_joint(axis='<axis xyz="0 0 1e200"/>'), "expected 3 finite numbers of at most 1e+18"),
    "a deep nest": (f"<robot>{'<a>' * 200_000}", "nests elements more than 50 deep, expected a URDF"),
    "an endless chain": (LONG, "has 6001 links, expected at most 500"),
    "a snake": (SNAKE, "has 33 joints that move, expected at most 32"),
    "negative mass": (
        one_joint(INERTIA.replace("1.5", "-1.5")),
        "link 'arm' has the mass -1.5 kg, expected 0",
    ),
    "NaN mass": (one_joint(INERTIA.replace("1.5", "nan")), "link 'arm': <mass value='nan'>"),
    "NaN inertia": (one_joint(INERTIA.replace('iyy="0.03"', 'iyy="nan"')), "<inertia iyy='nan'>"),
    "no inertia value": (one_joint(INERTIA.replace('iyy="0.03"', "")), "<inertia> has no 'iyy'"),
    "no mass": (one_joint("<inertial/>"), "link 'arm': <inertial> has no <mass>"),
    "branches": (TWO_HANDS, "joints 'left' and 'right' both hang on joint 'first', expected one chain"),
    "a ring aside": (
        RING.replace("</robot>", link("base") + "</robot>"),
        "no joints lead from 'base' to x, y, expected one tree",
    ),
    "loop": (LOOP, "joint 'third' leads to link 'upper', as another joint does"),
    "ring": (RING, "has 0 links without a parent [], expected one, the base"),
    "two bases": (TWO_BASES, "has 2 links without a parent ['base', 'lost'], expected one, the base"),
    "twins": (two_joints().replace('"second"', '"first"'), "has 2 joints named 'first', expected different"),
    "unknown link": (one_joint().replace('child link="arm"', 'child link="leg"'), "joins the link 'leg'"),
    "no child": (one_joint().replace('<child link="arm"/>', ""), "joint 'turn': <joint> has no <child>"),
    "no name": (one_joint().replace('<link name="arm"', "<link"), "<link> has no 'name'"),
    "unknown shape": (shape("<torus/>"), "collision geometry of torus, expected one of sphere, cylinder"),
    "empty geometry": (shape(""), "collision geometry of none, expected one of sphere"),
    "no radius": (shape("<sphere/>"), "link 'arm': <sphere> has no 'radius'"),
    "zero radius": (shape('<sphere radius="0"/>'), "<sphere radius='0'>, expected more than 0"),
    "negative box": (shape('<box size="1 -1 1"/>'), "<box size='1 -1 1'>, expected more than 0"),
    "NaN cylinder": (
        shape('<cylinder radius="1" length="nan"/>'),
        "<cylinder length='nan'>, expected a finite",
    ),
    "a mesh without a file": (shape("<mesh/>"), "link 'arm': <mesh> has no 'filename'"),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_is_refused(load, capfd, text, message):
    with pytest.raises(RobotError, match=re.escape(message)) as caught:
        load(text)
    assert "robot.urdf" in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_what_only_pinocchio_refuses_comes_with_its_reason(load, capfd):
    text = one_joint().replace("<robot ", '<robot version="9.9" ')
    with pytest.raises(RobotError, match=r"robot\.urdf: Pinocchio refuses it: .*version"):
        load(text)
    assert capfd.readouterr() == ("", "")


def test_a_snake_that_ends_where_its_refusal_says_is_an_arm_of_as_many_joints_as_may_be(load, tmp_path):
    with pytest.raises(RobotError, match=r"at most 32: .* ends the arm there") as caught:
        load(SNAKE)
    tip = re.search(r'robot\.tip="(\w+)"', str(caught.value))[1]
    assert load_robot(tmp_path / "robot.urdf", Setup(tip=tip)).joints == 32


def test_two_arms_on_one_base_are_refused(load):
    parts = [link("base", ""), joint("left", "base", "a"), link("a"), joint("right", "base", "b"), link("b")]
    with pytest.raises(
        RobotError, match="joints 'left' and 'right' both hang on the base, expected one chain"
    ):
        load(robot(*parts))


def test_an_unknown_name_is_answered_with_the_known_ones():
    with pytest.raises(RobotError, match="no robot named 'kuka_iiwa', expected kuka_lwr4, planar2 or a URDF"):
        load_robot("kuka_iiwa")


@pytest.mark.parametrize("kind", [str, Path])
def test_a_missing_file_is_named(tmp_path, kind):
    with pytest.raises(RobotError, match=r"no URDF file .*gone\.urdf"):
        load_robot(kind(tmp_path / "gone.urdf"))


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(RobotError, match="is a folder, expected a URDF file"):
        load_robot(tmp_path)


def test_a_name_that_no_file_can_have_is_refused():
    with pytest.raises(RobotError, match="cannot look for"):
        load_robot("x" * 5000 + ".urdf")


def test_a_file_that_cannot_be_read_is_refused(tmp_path, monkeypatch):
    file = tmp_path / "robot.urdf"
    file.write_text(one_joint(limit=LIMIT))
    monkeypatch.setattr(
        Path, "read_bytes", lambda _: (_ for _ in ()).throw(PermissionError(13, "Permission denied"))
    )
    with pytest.raises(RobotError, match=r"cannot read .*robot\.urdf: Permission denied"):
        load_robot(file)


def test_bytes_that_are_not_text_are_refused(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe\x00")
    with pytest.raises(RobotError, match="is not well-formed XML"):
        load_robot(file)
