"""Descriptions with missing or impossible masses, shapes and limits."""

import logging
import re
from contextlib import nullcontext
from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yaml

from sidegan.cell import Cell
from sidegan.errors import ConfigError, RobotError
from sidegan.identification.goals import usual_torque
from sidegan.motion.dynamics import RigidBody
from sidegan.plant import IDEAL, mujoco_model
from sidegan.robot import (
    Limits,
    Setup,
    command_messages,
    describe_doubtful_links,
    doubtful_links,
    inconsistent_links,
    load_robot,
    possible_links,
)
from sidegan.robot.consistency import describe_other_units
from sidegan.robot.units import reductions_of, transmissions
from sidegan.robot.visuals import visual_parts
from sidegan.robot.write_mjcf import mujoco_logged
from sidegan.validity.pairs import describe_displaced_shapes, random_configurations
from sidegan.validity.remedies import describe_placeholder_limits, refuse_other_units
from tests.chains import random_chain
from tests.identification.recordings import identified
from tests.identification.test_cases import recordings
from tests.pipeline.test_workspace import workspace
from tests.refusals import refused
from tests.robot.urdf import ball, collision, joint, limit, link, mesh, more, robot, visual

AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1")
LIMIT = limit(-2.8, 2.8, 2, 50)


def rod(place='xyz="0 0 0.15"'):
    return collision('<cylinder radius="0.04" length="0.24"/>', place)


def inertial(mass="2", moments=(0.02, 0.02, 0.004), place="0.01 0.005 0.15"):
    moments = " ".join(f'{name}="{x}"' for name, x in zip(("ixx", "iyy", "izz"), moments))
    moments += ' ixy="0" ixz="0" iyz="0"'
    return f'<inertial><origin xyz="{place}"/><mass value="{mass}"/><inertia {moments}/></inertial>'


def arm_of(content=None, limit=LIMIT, base=None):
    """URDF of four rods in a row; `content` replaces what links are made of, by number."""
    parts = [link("base", rod('xyz="0 0 0.02"') if base is None else base)]
    for k, axis in enumerate(AXES):
        place, before = f'xyz="0 0 {0.3 if k else 0.1}"', f"link{k - 1}" if k else "base"
        parts.append(joint(f"joint{k}", before, f"link{k}", "revolute", place, axis, limit))
        parts.append(link(f"link{k}", (content or {}).get(k, inertial() + rod())))
    return robot(*parts, name="rods")


BARE = dict.fromkeys(range(4), "")
KINDS = {  # what link 1 says of its mass, and what is said of that
    "the largest exceeds": inertial(moments=(0.02, 0.02, 0.042)),
    "too far out": inertial(moments=(-0.02, 0.02, 0.004)),
    "its mass is 0 kg": "",
    "its mass is 0 kg, expected more": inertial(mass=0),
    "its mass is 0 kg, ": inertial(mass=-3),
    "mass is 0 kg": inertial(mass="nan"),
    "1e-06 kg at": inertial(mass=1e-6, moments=(1e-9, 1e-9, 1e-9)),
    "2 kg at 150 m from its joint": inertial(place="10 5 150"),
    "": inertial(moments=(1e-9, 1e-9, 1e-9)),  # can be, and is too thin to start from
}


@pytest.mark.parametrize(("said", "inside"), KINDS.items(), ids=[*KINDS])
def test_an_impossible_link_is_reported_and_replaced_by_the_nearest_possible_one(load, said, inside):
    arm, whole = load(arm_of({1: inside + rod()})), load(arm_of()).inertial_parameters
    assert said in describe_doubtful_links(arm) and [*doubtful_links(arm)] == (["link1"] if said else [])
    start = possible_links(arm)
    assert inconsistent_links(arm, start) == [] and np.array_equal(start[[0, 2, 3]], whole[[0, 2, 3]])
    if "kg" not in said:  # mass and place are kept, and only the inertia is another
        np.testing.assert_allclose(start[1, :4], whole[1, :4])


def test_an_arm_is_identified_despite_missing_masses(load):
    truth, arm = load(arm_of()), load(arm_of(BARE))
    training, validation = recordings(arm=arm, truth=truth)
    found = identified(arm, [training], [validation])
    assert found.use == "consistent" and found.tested["consistent"].nmse_mean < 2e-3
    assert inconsistent_links(arm, found.links) == []


def test_identification_needs_neither_limits_nor_meshes(load, caplog, tmp_path):
    text = arm_of({1: inertial() + mesh("lost.stl")}, '<limit effort="50"/>')
    with refused(RobotError, "'joint0'", "limits="):
        load(text)
    caplog.clear()
    arm = load_robot(tmp_path / "robot.urdf", planning=False)
    assert not caplog.records and arm.velocity_limit.tolist() == [1.0] * 4
    assert "limits={'position': {'joint0': " in arm.notes[0]


@pytest.mark.parametrize(
    ("content", "base", "why"),
    [
        ("", "", "<inertial>"),
        ("", inertial(), "base"),
        (inertial(mass=0, moments=(0, 0, 0)), "", "0 kg"),
        (inertial(mass="nan"), "", "link 'link0': <mass value='nan'>"),
    ],
)
def test_usual_torques_without_masses_are_refused_with_the_reason(load, content, base, why):
    arm = load(arm_of(dict.fromkeys(range(4), content), base=base))
    with refused(ConfigError, "rods", why):
        usual_torque(RigidBody(arm))


@pytest.mark.parametrize("place", ["1 0 0.15", "0 -0.8 0.15", "0 0 1.2"])
def test_displaced_shapes_are_reported(load, place):
    said = describe_displaced_shapes(load(arm_of({1: inertial() + rod(f'xyz="{place}"')})))
    assert "never come close to each other: link0 – link1 (" in said
    arms = [load(arm_of()), load(arm_of(BARE, base="")), load_robot("kuka_lwr4"), load_robot("planar2")]
    assert [describe_displaced_shapes(arm) + describe_placeholder_limits(arm) for arm in arms] == [""] * 4


@pytest.mark.parametrize("shaped", [0, 1, 2, 3, 5])
def test_joint_origins_of_links_without_shapes_stay_above_the_floor(load, shaped):
    """Of an arm of which the base and the first links have shapes; heights are Pinocchio's."""
    place = replace(workspace(choice="desk"), clearance=None)
    bare = dict.fromkeys(range(max(shaped - 1, 0), 4), inertial())
    arm = load(arm_of(bare, base=None if shaped else ""))
    assert "floor at z = 0 m" in place.notes(arm)
    assert ("joint_origins" in place.stamped(arm)) == (0 < shaped < 5)
    said = (constraints := place.around(arm)).described()
    assert ("0 of 0 pairs" in said and "4 of 4 pairs of joint origins and regions" in said) == (shaped < 2)
    assert ("clear" in said) == (shaped > 1) == np.isfinite(constraints.nearest(np.zeros((1, 4)))[0]).all()
    model = pin.buildModelFromUrdf(str(arm.urdf))
    q = random_configurations(arm, 200)
    free = constraints.at_rest(q)["keep_out"].min(1) >= 0
    lowest = np.array([heights(model, x).min() for x in q])
    assert (lowest[free] >= 0).all() and (shaped > 1 or (free == (lowest >= 0)).all())
    assert free.any() and not free.all()


def heights(model, q):
    """Heights [m] of the origins of all joints but the first, which does not move, (J - 1,)."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return np.array([place.translation[2] for place in data.oMi[2:]])


@pytest.mark.parametrize(
    ("span", "velocity", "effort", "said"),
    [
        (2, 1000, 50, "velocity of joint0, joint1, joint2, joint3 (up to 1000)"),
        (2, 2, 1000, "limits={'effort': {'joint0': "),
        (10, 2, 50, "limits={'position': {'joint0': …, "),
        (100, 2, 50, "position of joint0, joint1, joint2, joint3 (up to 100)"),
    ],
)
def test_placeholder_limits_are_reported_with_the_setting_to_change(load, span, velocity, effort, said):
    arm = load(arm_of(limit=limit(-span, span, velocity, effort)))
    assert said in describe_placeholder_limits(arm)


def test_all_placeholder_limits_are_one_setting_in_python(load):
    said = describe_placeholder_limits(load(arm_of(limit=limit(-2, 2, 1000, 1000))))
    assert "are they the motors', in mN·m or mN, or placeholders?" in said
    assert said.count("limits={") == 1 and re.search(r"limits={'velocity': {.*}, 'effort': {.*}}$", said)


def test_a_sliding_joint_may_push_more_than_a_turning_one():
    arm, _ = random_chain(4, 2)
    slides = int(arm.prismatic.argmax())
    assert arm.prismatic[slides] and not arm.prismatic.all()
    for newtons, said in ((5e6, False), (2e7, True)):
        limits = np.where(np.arange(arm.joints) == slides, newtons, 50.0)
        words = describe_placeholder_limits(replace(arm, torque_limit=limits))
        assert (f"effort of {arm.joint_names[slides]}" in words) == said


def geared(ratio, **limits):
    """URDF with limits of the motors of all joints, and their gears in both spellings."""
    old = '<transmission name="{0}"><joint name="{0}"/><actuator name="m"><mechanicalReduction>{1}'
    new = '<ros2_control name="all" type="system"><transmission name="{0}"><joint name="{0}">'
    parts = [old.format(f"joint{k}", ratio) + END for k in (0, 1, 2)]
    parts.append(f"{new.format('joint3')}<mechanical_reduction>{ratio}{NEW_END}")
    return more(arm_of(limit=limit(**limits)), *parts)


END = "</mechanicalReduction></actuator></transmission>"
NEW_END = "</mechanical_reduction></joint></transmission></ros2_control>"
SLIDE = 'type="prismatic"'


def transmission(kind, gears=(2.0, -4.0), drives=(50.0, 80.0)):
    """A transmission of two joints as for ros_control and, with the second joint first, for ros2_control."""
    old = [f"<type>transmission_interface/{kind}</type>"]
    new = [f"<plugin>transmission_interface/{kind}</plugin>"]
    for tag, name, ratios in (("joint", "joint", gears), ("actuator", "m", drives)):
        for k, ratio in enumerate(ratios, 1):
            gear, role = "mechanicalReduction", f"<role>{tag}{k}</role>"
            old.append(f'<{tag} name="{name}{k}">{role}<{gear}>{ratio}</{gear}></{tag}>')
            gear, role = "mechanical_reduction", f'role="{tag}{k}"'
            new.insert(1, f'<{tag} name="{name}{k}" {role}><{gear}>{ratio}</{gear}></{tag}>')
    return [f"<robot><transmission>{''.join(parts)}</transmission></robot>" for parts in (old, new)]


# Joints' positions from the motors' a and b, as ros_control documents its transmissions.
TRANSMISSIONS = [
    ("DifferentialTransmission", lambda a, b: ((a / 50 + b / 80) / 2 / 2, (a / 50 - b / 80) / 2 / -4)),
    ("FourBarLinkageTransmission", lambda a, b: (a / 50 / 2, (b / 80 - a / 50 / 2) / -4)),
]


@pytest.mark.parametrize(("kind", "joints"), TRANSMISSIONS, ids=[kind for kind, _ in TRANSMISSIONS])
def test_transmissions_are_those_of_ros_control(kind, joints):
    expected = [0.7, *joints(13.0, -9.0)]
    for text in transmission(kind):
        root = ElementTree.fromstring(text)
        found = transmissions(root, ["other", "joint1", "joint2"]) @ [0.7, 13.0, -9.0]
        np.testing.assert_allclose(found, expected)
        assert not reductions_of(root)
        np.testing.assert_array_equal(transmissions(root, ["joint2", "other"]), np.eye(2))  # of another arm


def mixed(first, others=LIMIT, kind='type="revolute"'):
    """URDF of which one joint has another limit."""
    return arm_of(limit=others).replace(others, first, 1).replace('type="revolute"', kind, 1)


RAIL = mixed(limit(-1, 5, 3.0), kind=SLIDE)
LIMITS_ELSEWHERE = {  # descriptions, what is asked, and the line that is filled in
    "degrees": (arm_of(limit=limit(-166, 120)), "degrees", "position={joint0: [-2.89725, 2.0944], joint1: "),
    "one of them": (mixed(limit(-90, 160)), "degrees", "position={joint0: [-1.5708, 2.79253]}'"),
    "small": (mixed(limit(-5, 5), limit(-99, 120)), "degrees", "position={joint0: [-0.0872665, 0.0872665], "),
    "ticks": (arm_of(limit=limit(0, 4095)), "degrees", "position={joint0: …, joint1: …"),
    "ticks down": (arm_of(limit=limit(-4095, 0)), "degrees", "position={joint0: …, joint1: …"),
    "speeds": (arm_of(limit=limit(velocity=180)), "degrees per second", "velocity={joint0: 3.14159, joint1"),
    "motors' speeds": (geared(100, velocity=314), "motors", "velocity={joint0: 3.14, joint1: 3.14"),
    "strokes": (mixed(limit(-180, 20), kind=SLIDE), "millimetres", "position={joint0: [-0.18, 0.02]}'"),
    "mN·m": (arm_of(limit=limit(effort=2_500_000)), "mN·m", "effort={joint0: 2500, joint1: 2500"),
}


@pytest.mark.parametrize("name", LIMITS_ELSEWHERE)
def test_limits_in_other_units_are_refused_with_those_in_si(load, tmp_path, caplog, name):
    text, unit, filled = LIMITS_ELSEWHERE[name]
    with refused(RobotError, unit, f"robot.limits.{filled}") as caught, command_messages():
        load(text)
    load_robot(tmp_path / "robot.urdf", planning=False)  # an identification goes on, with a warning
    assert unit in caplog.text
    if "…" not in filled:  # the line is an answer
        kind, values = re.search(r"robot\.limits\.(\w+)=({.*?})'", str(caught.value)).groups()
        load_robot(tmp_path / "robot.urdf", Setup(limits=Limits(**{kind: yaml.safe_load(values)})))


def test_a_range_of_the_user_is_not_in_degrees_because_the_descriptions_are(load, tmp_path):
    text = mixed(limit(-5, 5), limit(-99, 120))
    own = Setup(limits=Limits(position={"joint0": (-0.08, 0.08)}))
    with refused(RobotError, "degrees", "'joint0': [-0.08, 0.08]", "'joint1': [-1.72788, 2.0944]"):
        load(text, own)
    assert load_robot(tmp_path / "robot.urdf", own, planning=False).position_upper[0] == 0.08


def test_limits_of_several_kinds_are_one_setting(load):
    text = mixed(limit(-180, 20, 180), limit(-166, 120, 180), kind=SLIDE)
    rail = "'joint0': [-0.18, 0.02]", "'joint0': 0.18"
    with refused(
        RobotError, "degrees", "millimetres", "'position': {'joint1'", "'velocity': ", *rail
    ) as caught:
        load(text)
    assert str(caught.value).count("limits={") == 1


def test_limits_that_the_user_repeats_are_taken(load):
    stated = Limits(position={f"joint{k}": (-166.0, 120.0) for k in range(4)})
    assert load(arm_of(limit=limit(-166, 120)), Setup(limits=stated)).position_upper[0] == 120


SOUND = {  # arms with unusual numbers, of which nothing is asked
    "two turns": arm_of(limit=limit(-12.56, 12.56)),
    "many turns": mixed(limit(-62.83, 62.83)),
    "an endless base": mixed(limit(-999999, 999999)),
    "fast wrists": mixed(limit(velocity=26.2)),
    "a rail": RAIL,
    "an excavator": arm_of(limit=limit(effort=450_000)),
    "gears": geared(100),
    "heavy": arm_of({0: inertial(mass="80", moments=(1, 1, 0.5)) + rod()}),
    "a flange": arm_of(
        {3: inertial(mass="0.008", moments=(3e-6, 3e-6, 5e-6), place="0 0 0.01") + ball(0.02)}
    ),
}


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_arm_is_asked_nothing(load, caplog, name):
    arm = load(SOUND[name])
    refuse_other_units(arm)
    assert describe_doubtful_links(arm) == "" and "beyond any" not in caplog.text


def scaled(mass=1.0, moment=1.0):
    """URDF whose masses and inertias are in other units."""
    own = inertial(mass=2 * mass, moments=[x * moment for x in (0.02, 0.02, 0.004)])
    return arm_of({k: own + rod() for k in range(4)})


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        (scaled(1e3, 1e3), ["8000 kg", "1.1 m", "grams", "link0 2, link1 2, "]),
        (scaled(1e3), ["grams"]),
        (scaled(moment=1e6), ["kg·mm²", "link0 105 m, [0.02 "]),
        (scaled(moment=1e9), ["g·mm²"]),
        (geared(101, effort=0.5), ["motors", "limits={'effort': {'joint0': 50.5, 'joint1': 50.5, "]),
    ],
    ids=["grams", "only masses", "kg·mm²", "g·mm²", "motors' torques"],
)
def test_masses_and_torques_in_other_units_are_refused_unless_torques_do_not_count(tmp_path, text, asked):
    (tmp_path / "arm.urdf").write_text(text)
    with refused(RobotError, "workspace={'torque': False}", *asked):
        _ = Cell(tmp_path / "arm.urdf").arm
    assert Cell(tmp_path / "arm.urdf", workspace={"torque": False}).whole_arm.joints == 4
    recorded = Cell(tmp_path / "arm.urdf").recorded_arm
    assert (describe_other_units(recorded) != "") == ("motors" not in asked)


@pytest.mark.parametrize("part", ["joint", "inertial", "collision", "visual"])
def test_angles_in_degrees_are_refused_where_they_count(load, part):
    turned = {
        "joint": arm_of().replace('<origin xyz="0 0 0.3"/>', '<origin xyz="0 0 0.3" rpy="0 90 0"/>', 1),
        "inertial": arm_of({1: inertial().replace("/><mass", ' rpy="0 90 0"/><mass') + rod()}),
        "collision": arm_of({1: inertial() + rod('xyz="0 0 0.15" rpy="0 90 0"')}),
        "visual": arm_of({1: inertial() + rod() + visual("<sphere radius='1'/>", 'rpy="0 90 0"')}),
    }[part]
    asked = refused(RobotError, "1'", 'rpy="0 90 0"', 'rpy="0 1.5708 0"')
    with nullcontext() if part == "visual" else asked:
        load(turned)


def test_unreadable_angles_of_a_link_are_reported_with_its_name(load):
    with refused(RobotError, "'link1'", "rpy='0 0'"):
        load(arm_of({1: inertial() + rod('xyz="0 0 0.15" rpy="0 0"')}))
    arm = load(arm_of({1: inertial().replace("/><mass", ' rpy="nan 0 0"/><mass') + rod()}))
    assert "'link1'" in arm.massless[0] and "rpy='nan 0 0'" in arm.massless[0]


def test_mujoco_warnings_are_logged_and_lost_visuals_give_one_message(load, tmp_path, monkeypatch, caplog):
    monkeypatch.chdir(tmp_path)
    model = mujoco_model(load_robot("planar2"), IDEAL)
    data = mujoco.MjData(model)
    data.qfrc_applied[:] = 1e12
    with caplog.at_level(logging.DEBUG):
        with mujoco_logged("planar2"):
            mujoco.mj_step(model, data, 50)
        assert "planar2: " in caplog.text and not (tmp_path / "MUJOCO_LOG.TXT").exists()
        visual_parts(load(arm_of({k: inertial() + mesh(f"{k}.stl") for k in range(4)})))
    shown = [record for record in caplog.records if "not shown" in record.message]
    assert len(shown) == 1 and "link0, link1, link2, link3" in shown[0].message
