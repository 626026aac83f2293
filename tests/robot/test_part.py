"""An arm that is part of a description: its dynamics against Pinocchio's reduced model, and what is said."""

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sidegan.errors import RobotError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Limits, Setup, changes, load_robot, with_effort, write_urdf
from sidegan.robot.tree import read_tree
from sidegan.robot.visuals import visual_parts
from tests.refusals import refused

from .judge import Facts, Judge
from .urdf import INERTIA, ball, joint, link, more, one_joint, robot, two_joints

SOLID = INERTIA + ball(0.05)
PLACE = 'xyz="0.1 -0.2 0.3" rpy="0.7 1.5707963267948966 -0.4"'  # pitched by a right angle
ENDLESS = '<limit velocity="1" effort="2"/>'


FOOT = joint("glue", "base", "foot", "fixed", limit="")
# A torso that turns, two arms of two joints, a sliding thumb at the left one, and what mimics it.
FOLLOWS = '<mimic joint="left_thumb" multiplier="-2" offset="0.1"/>'
PERSON = robot(
    link("floor", ""),
    joint("waist", "floor", "torso", axis="0 0.6 0.8"),
    link("torso", SOLID),
    joint("left_shoulder", "torso", "left_upper", origin=PLACE),
    link("left_upper", SOLID),
    joint("left_elbow", "left_upper", "left_lower", axis="0.6 0 0.8"),
    link("left_lower", SOLID),
    joint("left_thumb", "left_lower", "nail", "prismatic", origin=PLACE, axis="1 2 2"),
    link("nail"),
    joint("left_index", "left_lower", "tip", extra=FOLLOWS),
    link("tip", SOLID),
    joint("right_shoulder", "torso", "right_upper", origin=PLACE, axis="0 1 0"),
    link("right_upper", SOLID),
    joint("right_elbow", "right_upper", "right_lower", "continuous", limit=ENDLESS),
    link("right_lower", SOLID),
)


def test_two_shapes_in_one_geometry_of_another_limb_both_count(tmp_path):
    """They stop only whoever asks for the arm that has them."""
    both = SOLID.replace("<geometry>", '<geometry><box size="0.1 0.1 0.3"/>')
    (tmp_path / "a.urdf").write_text(PERSON.replace(link("right_upper", SOLID), link("right_upper", both)))
    arm = load_robot(tmp_path / "a.urdf", Setup(tip="left_lower"))
    assert arm.capsules.owners.count("right_upper") == 2
    with refused(RobotError, "'right_upper'", "box, sphere"):
        load_robot(tmp_path / "a.urdf", Setup(tip="right_lower"))


LEFT = {"left_shoulder": 0.25, "left_elbow": 0.25, "left_thumb": 0.25, "left_index": -0.4}
RIGHT = {"right_shoulder": 0.25, "right_elbow": 0.0}
PARTS = {  # what is asked for, and where the joints stand that do not move
    "the left arm": (Setup(tip="left_lower"), {"left_thumb": 0.25, "left_index": -0.4, **RIGHT}),
    "the left arm from the torso on": (
        Setup(tip="left_lower", locked={"waist": -1.1, "left_thumb": 1.7, "right_elbow": 2.5}),
        {"waist": -1.1, "left_thumb": 1.7, "left_index": -3.3, "right_shoulder": 0.25, "right_elbow": 2.5},
    ),
    "the right arm with a stiff shoulder": (
        Setup(tip="right_lower", locked={"right_shoulder": 0.9}),
        {"right_shoulder": 0.9, **LEFT},
    ),
    "the left thumb": (Setup(tip="nail", locked={"left_index": 0.3}), {"left_index": 0.3, **RIGHT}),
}


@pytest.mark.parametrize(("setup", "locked"), PARTS.values(), ids=PARTS)
def test_torque_equals_pinocchios_reduced_model(load, setup, locked):
    arm = load(PERSON, setup)
    judge = Judge(arm.urdf, arm.joint_names, Facts(locked=locked))
    assert {*arm.joint_names, "universe"} == {*judge.model.names}
    draw = np.random.default_rng(0).uniform(-1, 1, (3, 50, arm.joints))
    q, dq, ddq = draw * np.array([3.0, 2.0, 5.0])[:, None, None]
    expected = judge.efforts(judge.configurations(q), dq, ddq)
    np.testing.assert_allclose(RigidBody(arm).torque(q, dq, ddq), expected, rtol=0, atol=1e-9)  # N·m


def test_locked_parts_are_reported_and_stay_in_the_collision_model(load):
    arm = load(PERSON, Setup(tip="left_lower", locked={"waist": 0.25}))
    notes = "; ".join(arm.notes)
    assert "right_shoulder at 0.25 rad" in notes and "left_thumb at 0.25 m" in notes
    assert "3 kg of nail, tip lumped into left_lower" in notes
    assert "fixed to the base: torso, right_upper, right_lower" in notes
    still, moving = dict.fromkeys(["torso", "right_upper", "right_lower"], -1), {"left_upper": 0}
    owners = dict(zip(arm.capsules.owners, arm.capsules.link.tolist()))
    assert owners == {**still, **moving, "left_lower": 1, "tip": 1}


FLOATING = two_joints().replace('name="first" type="revolute"', 'name="first" type="floating"')
MIMIC = two_joints(extra='<mimic joint="first"/>')
SIX = [joint(f"a{k}", f"l{k}", f"l{k + 1}") + link(f"l{k + 1}") for k in range(6)]
FINGERS = [joint(finger, "l6", f"tip_{finger}") + link(f"tip_{finger}") for finger in "xyz"]
HAND = robot(link("l0", ""), *SIX, *FINGERS)
LEVER = joint("j_lever", "base", "lever", extra='<mimic joint="first"/>') + link("lever")
BESIDE = more(two_joints(), LEVER)
TIE = '<drake:loop_joint name="t"><link1 link="lever"/><link2 link="upper"/></drake:loop_joint>'
OPEN = more(two_joints(), LEVER.replace('<mimic joint="first"/>', ""), TIE)
THIRD = joint("third", "upper", "wrist", extra='<mimic joint="second"/>') + link("wrist")
REMEDIES = [
    (BESIDE, "locked={'j_lever': 0}", Setup(locked={"j_lever": 0.0}), "first second"),
    (more(two_joints(), THIRD), "tip='lower'", Setup(tip="lower"), "first"),
    (MIMIC, "locked={'second': 0}", Setup(locked={"second": 0.0}), "first"),
    (FLOATING, "locked={'first': 0}", Setup(locked={"first": 0.0}), "second"),
    (HAND, "tip='l6' (6 joints: a0 to a5)", Setup(tip="l6"), "a0 a1 a2 a3 a4 a5"),
]


class TestWhichChain:
    def test_a_branching_description_is_refused_with_tips_that_work(self, load):
        with refused(RobotError) as caught:
            load(PERSON)
        tips = re.findall(r"tip='(\w+)' \((\d) joint", str(caught.value))
        assert tips == [("left_lower", "3"), ("right_lower", "3"), ("torso", "1")]
        for tip, joints in tips:
            assert load(PERSON, Setup(tip=tip)).joints == int(joints)

    @pytest.mark.parametrize("name", ["gripper", "first"])
    def test_a_gripper_and_its_mimic_finger_are_locked(self, load, name):
        finger = joint("other", "arm", "right", "prismatic", extra=f'<mimic joint="{name}"/>')
        gripper = joint(name, "arm", "left", "prismatic"), link("left"), finger, link("right")
        arm = load(more(one_joint(), *gripper))
        assert arm.joint_names == ("turn",)
        assert f"locked {name} at 0.25 m, other at 0.25 m" in arm.notes

    @pytest.mark.parametrize(("text", "setting", "remedy", "left"), REMEDIES)
    def test_a_refusal_suggests_a_setting_that_works(self, load, text, setting, remedy, left):
        with refused(RobotError, setting):
            load(text)
        assert " ".join(load(text, remedy).joint_names) == left

    def test_a_loop_beside_the_joints_is_named_and_open_only_if_the_user_says_so(self, load):
        with refused(RobotError, "loop_joint t (lever, upper)", "first, second", "locked={'j_lever': "):
            load(OPEN, Setup(tip="upper"))
        arm = load(OPEN, Setup(tip="upper", locked={"j_lever": 0.25}))
        assert arm.joint_names == ("first", "second")
        assert any("loop_joint t" in note for note in arm.notes)
        gazebo = TIE.replace("drake:loop_joint", "joint")
        gazebo = f"<gazebo>{gazebo}<plugin><joint>first</joint></plugin></gazebo>"
        with refused(RobotError, "joint t (lever, upper)", "first"):
            load(OPEN.replace(TIE, gazebo), Setup(tip="upper"))


class TestLimits:
    def test_a_continuous_joint_has_half_a_turn_either_way_from_home(self, load):
        text = one_joint(kind="continuous", limit=ENDLESS)
        arm = load(text, home=[0.5])
        assert arm.position_lower.item() == pytest.approx(0.5 - math.pi)
        assert arm.position_upper.item() == pytest.approx(0.5 + math.pi)
        assert "turn -2.642 to 3.642 rad" in "; ".join(arm.notes)
        wider = load(text, Setup(limits=Limits(position={"turn": (-80.0, 80.0)})))  # and these are no degrees
        assert (wider.position_lower.item(), wider.position_upper.item()) == (-80, 80)
        assert wider.notes == ()

    def test_all_missing_limits_are_asked_for_at_once(self, load):
        text = two_joints(limit='<limit lower="1" upper="-1"/>').replace('velocity="2.5"', 'velocity="0"')
        asked = (
            "{'effort': {'first': 3}, 'velocity': {'first': 1, 'second': 1}, 'position': {'second': [-1, 1]}}"
        )
        with refused(RobotError, f"limits={asked}"):
            load(text, Setup(limits=Limits(effort={"first": 3.0})))
        limits = Limits(velocity={"first": 1.0, "second": 1.0}, position={"second": (-1.0, 1.0)})
        assert load(text, Setup(limits=limits)).velocity_limit.tolist() == [1, 1]

    def test_suggestions_keep_what_the_user_gave_beside(self, load, tmp_path):
        endless = two_joints(kind="continuous", limit=ENDLESS)
        (note,) = load(endless, Setup(limits=Limits(position={"first": (-1.0, 1.0)}, effort=3.0))).notes
        assert "'position': {'first': [-1, 1], 'second': [-6.28319, 6.28319]}, 'effort': {'first': 3" in note
        with refused(RobotError, "locked={'first': 0.5, 'second': 2}"):
            load(two_joints(), Setup(locked={"first": 0.5, "second": 9.0}))
        file = tmp_path / "limits.yaml"
        file.write_text("joint_limits: {first: {max_acceleration: 3.0}}")
        with refused(RobotError, f"limits={{'file': '{file}', 'velocity': {{'second': 1}}}}"):
            load(two_joints(limit='<limit lower="-1" upper="1"/>'), Setup(limits=Limits(file=str(file))))

    def test_the_user_overrides_the_description(self, load, caplog):
        """And is warned, once, where the description's limits are narrower."""
        own = Limits({"first": (-1.6, 3.0)}, velocity={"second": 0.7}, effort={"first": 41.0})
        arm = load(two_joints(), Setup(limits=own))
        assert arm.velocity_limit.tolist() == [2.5, 0.7] and arm.torque_limit.tolist() == [41, 40]
        assert "lower of first -1.6 instead of -1.5 rad; upper of first 3 instead of 2 rad" in caplog.text
        assert "effort of first 41 instead of 40 N·m" in caplog.text and "velocity of" not in caplog.text
        assert visual_parts(arm) == [] and caplog.text.count("limits are wider") == 1

    def test_a_range_that_is_widened_at_an_end_of_zero_is_told(self, load, caplog):
        rail = one_joint(kind="prismatic", limit='<limit lower="0" upper="0.5" velocity="1"/>')
        load(rail, Setup(limits=Limits(position={"turn": (-0.1, 0.5)})))
        assert "lower of turn -0.1 instead of 0 m" in caplog.text and "upper of" not in caplog.text

    def test_a_limit_that_is_no_number_gives_way_to_the_users_when_written(self, load, tmp_path):
        text = one_joint(limit='<limit lower="-1" upper="1" velocity="fast" effort="5"/>')
        arm = load(text, Setup(limits=Limits(velocity=1.5)))
        write_urdf(arm, arm.inertial_parameters, tmp_path / "out.urdf")
        assert load_robot(tmp_path / "out.urdf").velocity_limit.tolist() == [1.5]

    def test_acceleration_and_jerk_limits_are_part_of_the_digest(self, load):
        three, four = {"first": 3.0}, {"first": 3.5}
        kinds = [(three, None), (four, None), ({"second": 3.0}, None), (None, three), (three, three)]
        given = [Setup(limits=Limits(acceleration=acceleration, jerk=jerk)) for acceleration, jerk in kinds]
        bare, *arms = (load(two_joints(), setup) for setup in (None, *given))
        assert len({bare.digest, *(arm.digest for arm in arms)}) == 6 and bare.higher_limits == {}
        assert load(two_joints(), given[-1]).digest == arms[-1].digest
        assert list(arms[-1].higher_limits) == ["acceleration", "jerk"]
        assert arms[-1].higher_limits["jerk"].tolist() == [3, math.inf]
        gentle = with_effort(arms[-1], 0.5)
        assert gentle.higher_limits == arms[-1].higher_limits and gentle.digest != arms[-1].digest

    def test_only_a_share_of_speed_and_torque_is_used(self, planar):
        gentle = with_effort(planar, 0.5)
        for name, share in (("velocity_limit", 0.5), ("torque_limit", 0.5), ("position_upper", 1.0)):
            np.testing.assert_allclose(getattr(gentle, name), share * getattr(planar, name))
        assert with_effort(planar, 1.0) is planar
        digests = {with_effort(planar, effort).digest for effort in (0.3, 0.5, 1.0)}
        assert len(digests) == 3 and with_effort(planar, 0.5).digest == gentle.digest


def test_a_mounted_arm_is_the_same_one_turned(tmp_path):
    """Joints, shapes and pictures turn together; gravity stays, which is what its torques then show."""
    path, mount = tmp_path / "arm.urdf", (0.4, -0.5, 0.6)
    path.write_text(more(two_joints(origin=PLACE), link("foot", ball(0.1, "0.3 0.2 0.1")), FOOT))
    upright, mounted = load_robot(path), load_robot(path, Setup(mount=mount))
    turn = pin.rpy.rpyToMatrix(*mount)
    np.testing.assert_allclose(mounted.rotation[0], turn @ upright.rotation[0])
    np.testing.assert_allclose(mounted.translation[0], turn @ upright.translation[0])
    np.testing.assert_allclose(mounted.rotation[1:], upright.rotation[1:])
    foot, standing = (arm.capsules.a[arm.capsules.link < 0] for arm in (mounted, upright))
    np.testing.assert_allclose(foot, standing @ turn.T)
    shown, still = (visual_parts(arm)[0].vertices.mean(0) for arm in (mounted, upright))
    np.testing.assert_allclose(shown, turn @ still, atol=1e-12)
    assert mounted.digest != upright.digest and any("mounted with roll 0.4" in note for note in mounted.notes)
    states = np.random.default_rng(0).random((3, 5, 2))
    tilted = replace(upright, gravity=turn.T @ upright.gravity)
    np.testing.assert_allclose(RigidBody(mounted).torque(*states), RigidBody(tilted).torque(*states))
    write_urdf(mounted, mounted.inertial_parameters, tmp_path / "written.urdf")
    assert changes("robot", mounted.setup) == ["'robot.mount=[0.4, -0.5, 0.6]'"]


@pytest.mark.parametrize("pillar", ["world", "pillar"])
def test_a_pillar_behind_a_base_without_a_shape_is_no_neighbour_of_the_first_link(pillar):
    parts = (
        *(link(pillar), joint("stand", pillar, "base", "fixed", limit=""), link("base", "")),
        *(joint("first", "base", "one"), link("one"), joint("second", "one", "two"), link("two")),
    )
    tree = read_tree(ET.fromstring(robot(*parts)), "arm")
    assert tree.parents({pillar, "one", "two"}) == {("two", "one")}
    assert tree.parents({pillar, "base", "one", "two"}) >= {("two", "one"), ("one", "base")}
