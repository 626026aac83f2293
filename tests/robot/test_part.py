"""An arm that is part of a description: its dynamics against Pinocchio's reduced model, and what is said."""

import math
import re

import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.errors import RobotError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Limits, Setup, load_robot, pinocchio_model, with_effort, write_urdf

from . import urdf
from .urdf import joint, link, one_joint, robot, two_joints

INERTIA = urdf.INERTIA.replace('ixx="0.02"', 'ixx="0.025"')  # of a link that can exist
BALL = '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
PLACE = 'xyz="0.1 -0.2 0.3" rpy="0.7 1.5707963267948966 -0.4"'  # pitched by a right angle


def axis(words: str) -> str:
    return f'<axis xyz="{words}"/>'


def person() -> str:
    """A torso that turns, two arms of two joints, a sliding thumb at the left one, and what mimics it."""
    return robot(
        link("floor", ""),
        joint("waist", "floor", "torso", axis=axis("0 0.6 0.8")),
        link("torso", INERTIA + BALL),
        joint("left_shoulder", "torso", "left_upper", origin=PLACE),
        link("left_upper", INERTIA + BALL),
        joint("left_elbow", "left_upper", "left_lower", axis=axis("0.6 0 0.8")),
        link("left_lower", INERTIA + BALL),
        joint("left_thumb", "left_lower", "nail", "prismatic", origin=PLACE, axis=axis("1 2 2")),
        link("nail"),
        joint(
            "left_index",
            "left_lower",
            "tip",
            extra='<mimic joint="left_thumb" multiplier="-2" offset="0.1"/>',
        ),
        link("tip", INERTIA + BALL),
        joint("right_shoulder", "torso", "right_upper", origin=PLACE, axis=axis("0 1 0")),
        link("right_upper", INERTIA + BALL),
        joint(
            "right_elbow",
            "right_upper",
            "right_lower",
            "continuous",
            limit='<limit velocity="1" effort="2"/>',
        ),
        link("right_lower", INERTIA + BALL),
    )


def reduced(text: str, locked: dict[str, float]) -> pin.Model:
    """Pinocchio's own model of a description with joints locked."""
    model = pin.buildModelFromXML(text)
    q = pin.neutral(model)
    for name, value in locked.items():
        one = model.joints[model.getJointId(name)]
        q[one.idx_q : one.idx_q + one.nq] = [value] if one.nq == 1 else [math.cos(value), math.sin(value)]
    return pin.buildReducedModel(model, [model.getJointId(name) for name in locked], q)


PARTS = {
    "the left arm": (
        Setup(tip="left_lower"),
        {"waist", "left_shoulder", "left_elbow"},
        {"left_thumb": 0.25, "left_index": -0.4, "right_shoulder": 0.25, "right_elbow": 0.0},
    ),
    "the left arm from the torso on": (
        Setup(base="torso", tip="left_lower", locked={"waist": -1.1, "left_thumb": 1.7, "right_elbow": 2.5}),
        {"left_shoulder", "left_elbow"},
        {"waist": -1.1, "left_thumb": 1.7, "left_index": -3.3, "right_shoulder": 0.25, "right_elbow": 2.5},
    ),
    "the right arm with a stiff shoulder": (
        Setup(tip="right_lower", locked={"right_shoulder": 0.9}),
        {"waist", "right_elbow"},
        {
            "right_shoulder": 0.9,
            "left_shoulder": 0.25,
            "left_elbow": 0.25,
            "left_thumb": 0.25,
            "left_index": -0.4,
        },
    ),
    "the left thumb": (
        Setup(tip="nail", locked={"left_index": 0.3}),
        {"waist", "left_shoulder", "left_elbow", "left_thumb"},
        {"left_index": 0.3, "right_shoulder": 0.25, "right_elbow": 0.0},
    ),
}


@pytest.mark.parametrize(("setup", "moving", "locked"), PARTS.values(), ids=PARTS.keys())
def test_torque_is_that_of_the_reduced_model(tmp_path, setup, moving, locked):
    path = tmp_path / "person.urdf"
    path.write_text(person())
    arm = load_robot(path, setup)
    assert set(arm.joint_names) == moving
    oracle = reduced(person(), locked)
    data, random = oracle.createData(), np.random.default_rng(0)
    states = random.uniform(-1, 1, (3, 50, arm.joints)) * np.array([3.0, 2.0, 5.0])[:, None, None]
    order = [oracle.joints[oracle.getJointId(name)] for name in arm.joint_names]
    expected = []
    for q, dq, ddq in zip(*states):
        whole, v, a = pin.neutral(oracle), np.zeros(oracle.nv), np.zeros(oracle.nv)
        for one, *now in zip(order, q, dq, ddq):
            x = now[0]
            whole[one.idx_q : one.idx_q + one.nq] = [x] if one.nq == 1 else [math.cos(x), math.sin(x)]
            v[one.idx_v], a[one.idx_v] = now[1:]
        torque = pin.rnea(oracle, data, whole, v, a)
        expected.append([torque[one.idx_v] for one in order])
    found = RigidBody(arm).torque(*(torch.from_numpy(x) for x in states))
    np.testing.assert_allclose(found.numpy(), expected, rtol=0, atol=1e-9)  # N·m


def test_what_stands_still_is_told_and_stays_in_the_collision_model(tmp_path):
    path = tmp_path / "person.urdf"
    path.write_text(person())
    arm = load_robot(path, Setup(base="torso", tip="left_lower"))
    told = "; ".join(arm.told)
    assert "right_shoulder at 0.25 rad" in told
    assert "left_thumb at 0.25 m" in told
    assert "3 kg of nail, tip lumped into left_lower" in told
    assert "standing still with the base: torso, right_upper, right_lower" in told
    owners = dict(zip(arm.capsules.names, arm.capsules.link.tolist()))
    assert owners == {
        "torso": -1,
        "right_upper": -1,
        "right_lower": -1,
        "left_upper": 0,
        "left_lower": 1,
        "tip": 1,
    }


def test_an_arm_with_other_inertias_is_written_for_the_same_part(tmp_path):
    path = tmp_path / "person.urdf"
    path.write_text(person())
    arm = load_robot(path, Setup(tip="left_lower", locked={"left_thumb": 0.7}))
    parameters = 1.25 * arm.inertial_parameters
    write_urdf(arm, parameters, tmp_path / "heavier.urdf")
    again = load_robot(tmp_path / "heavier.urdf", arm.setup)
    np.testing.assert_allclose(again.inertial_parameters, parameters, rtol=0, atol=1e-11)
    assert pinocchio_model(again).nv == 3


class TestWhichChain:
    def test_branches_are_refused_with_tips_that_work(self, tmp_path):
        path = tmp_path / "person.urdf"
        path.write_text(person())
        with pytest.raises(RobotError, match="expected one chain") as caught:
            load_robot(path)
        tips = re.findall(r"robot\.tip=(\w+) \((\d) joint", str(caught.value))
        assert tips == [("left_lower", "3"), ("right_lower", "3"), ("torso", "1")]
        for tip, joints in tips:
            assert load_robot(path, Setup(tip=tip)).joints == int(joints)

    def test_a_gripper_is_left_out_by_its_name_and_a_finger_that_mimics_with_it(self, load):
        text = robot(
            link("base", ""),
            joint("turn", "base", "arm"),
            link("arm"),
            joint("gripper", "arm", "left", "prismatic"),
            link("left"),
            joint("other", "arm", "right", "prismatic", extra='<mimic joint="gripper"/>'),
            link("right"),
        )
        arm = load(text)
        assert arm.joint_names == ("turn",)
        assert "locked gripper at 0.25 m, other at 0.25 m" in arm.told

    def test_a_hand_is_where_the_arm_ends(self, tmp_path):
        parts = [link("l0", "")]
        for k in range(6):
            parts += [joint(f"a{k}", f"l{k}", f"l{k + 1}"), link(f"l{k + 1}")]
        for finger in "xyz":
            parts += [joint(finger, "l6", f"tip_{finger}"), link(f"tip_{finger}")]
        path = tmp_path / "hand.urdf"
        path.write_text(robot(*parts))
        with pytest.raises(RobotError, match=r"where it ends: robot\.tip=l6 \(6 joints: a0 to a5\)$"):
            load_robot(path)
        assert load_robot(path, Setup(tip="l6")).joints == 6

    @pytest.mark.parametrize(
        ("setup", "message"),
        [
            (Setup(tip="hand"), r"has no link 'hand', expected for example robot\.tip="),
            (Setup(base="hand", tip="torso"), r"has no link 'hand', expected for example robot\.base="),
            (
                Setup(base="right_upper", tip="left_lower"),
                "link 'left_lower' does not hang on link 'right_upper'",
            ),
            (
                Setup(base="left_lower", tip="left_lower"),
                "no joints that move behind 'left_lower' before 'left_",
            ),
            (Setup(base="tip"), "no joints that move behind 'tip'"),
            (Setup(locked={"right_elbo": 0.0}), "no joint 'right_elbo' .* for example right_elbow"),
            (
                Setup(locked={"waist": 7.0}),
                r"'waist' is locked at 7, outside its range -1.5 to 2; .* 'robot.locked=\{waist: 2\}'",
            ),
        ],
    )
    def test_what_is_not_there_is_refused(self, tmp_path, setup, message):
        path = tmp_path / "person.urdf"
        path.write_text(person())
        with pytest.raises(RobotError, match=message):
            load_robot(path, setup)

    def test_a_mimic_joint_of_one_that_moves_is_refused_until_it_is_locked(self, tmp_path):
        path = tmp_path / "small.urdf"
        path.write_text(two_joints(extra='<mimic joint="first"/>'))
        with pytest.raises(RobotError, match=r"'robot\.locked=\{second: 0\}'"):
            load_robot(path)
        assert load_robot(path, Setup(locked={"second": 0.0})).joint_names == ("first",)

    def test_the_base_of_one_of_two_trees_drops_the_other(self, tmp_path):
        path = tmp_path / "two.urdf"
        path.write_text(one_joint().replace("</robot>", link("lost") + "</robot>"))
        with pytest.raises(RobotError, match=r"choose one, robot\.base=base"):
            load_robot(path)
        assert load_robot(path, Setup(base="base")).joint_names == ("turn",)

    def test_a_floating_base_is_refused_until_the_arm_begins_behind_it(self, tmp_path):
        text = two_joints().replace('name="first" type="revolute"', 'name="first" type="floating"')
        path = tmp_path / "free.urdf"
        path.write_text(text)
        with pytest.raises(RobotError, match=r"robot\.base=lower has it stand still"):
            load_robot(path)
        assert load_robot(path, Setup(base="lower")).joint_names == ("second",)


class TestLimits:
    def load(self, tmp_path, text, **settings):
        path = tmp_path / "robot.urdf"
        path.write_text(text)
        home = settings.pop("home", None)
        return load_robot(path, Setup(**settings), home)

    def test_a_continuous_joint_may_turn_by_half_a_turn_from_home(self, tmp_path):
        text = one_joint(kind="continuous", limit='<limit velocity="1" effort="2"/>')
        arm = self.load(tmp_path, text, home=[0.5])
        assert arm.position_lower.item() == pytest.approx(0.5 - math.pi)
        assert arm.position_upper.item() == pytest.approx(0.5 + math.pi)
        assert "turn -2.642 to 3.642 rad" in "; ".join(arm.told)
        wider = self.load(tmp_path, text, limits=Limits(position={"turn": (-9.0, 9.0)}))
        assert (wider.position_lower.item(), wider.position_upper.item()) == (-9, 9)
        assert wider.told == ()

    def test_all_that_is_missing_is_asked_for_at_once(self, tmp_path):
        text = two_joints(limit='<limit lower="1" upper="-1"/>').replace('velocity="2.5"', 'velocity="0"')
        with pytest.raises(RobotError) as caught:
            self.load(tmp_path, text, limits=Limits(effort={"first": 3.0}))
        assert "'robot.limits.velocity={first: 1, second: 1}'" in str(caught.value)
        assert "'robot.limits.position={second: [-1, 1]}'" in str(caught.value)
        limits = Limits(velocity={"first": 1.0, "second": 1.0}, position={"second": (-1.0, 1.0)})
        arm = self.load(tmp_path, text, limits=limits)
        assert arm.velocity_limit.tolist() == [1, 1]

    def test_the_user_overrides_the_file_and_the_file_the_description(self, tmp_path, caplog):
        (tmp_path / "joint_limits.yaml").write_text(
            "joint_limits:\n"
            "  first: {has_velocity_limits: true, max_velocity: 1.1, has_acceleration_limits: true,\n"
            "          max_acceleration: 3.5, has_jerk_limits: false, max_jerk: 0}\n"
            "  second: {max_velocity: 1.2, max_effort: 7, min_position: !degrees -90, max_position: 1}\n"
            "  finger: {max_velocity: 0.1}\n"
        )
        arm = self.load(
            tmp_path,
            two_joints(),
            limits_file=str(tmp_path / "joint_limits.yaml"),
            limits=Limits(velocity={"second": 0.7}, jerk={"first": 50.0}),
        )
        assert arm.velocity_limit.tolist() == [1.1, 0.7]
        assert arm.torque_limit.tolist() == [40, 7]
        assert arm.position_lower.tolist() == [-1.5, -math.pi / 2]
        assert arm.acceleration_limit.tolist() == [3.5, math.inf]
        assert arm.jerk_limit.tolist() == [50, math.inf]
        assert "joint_limits.yaml limits finger, which is not there" in arm.told
        assert "position of second -1.571 to 1 instead of -1.5 to 2 rad" in caplog.text
        assert "velocity of" not in caplog.text and "effort of" not in caplog.text

    def test_a_misspelt_joint_of_the_file_is_told_with_what_is_meant(self, tmp_path):
        file = tmp_path / "joint_limits.yaml"
        file.write_text("joint_limits: {secnd: {max_velocity: 1}, first: {max_velocity: 1}, hand: {}}")
        arm = self.load(tmp_path, two_joints(), limits_file=str(file))
        assert "limits secnd, hand, which are not there; did you mean second?" in arm.told[-1]

    def test_limits_wider_than_the_descriptions_are_told_with_both_numbers(self, tmp_path, caplog):
        wide = Limits(velocity={"second": 90.0}, effort={"first": 41.0}, position={"first": (-1.5, 2.5)})
        self.load(tmp_path, two_joints(), limits=wide)
        (told,) = [record.getMessage() for record in caplog.records]
        assert "velocity of second 90 instead of 2.5 rad/s" in told
        assert "effort of first 41 instead of 40 N·m" in told
        assert "position of first -1.5 to 2.5 instead of -1.5 to 2 rad" in told
        caplog.clear()
        self.load(tmp_path, two_joints(), limits=Limits(velocity={"second": 2.5}, effort={"first": 3.0}))
        assert not caplog.records

    def test_ranges_in_degrees_are_refused_with_what_they_are_in_radians(self, tmp_path):
        degrees = Limits(position={"first": (-80.0, 80.0), "second": (-1.0, 1.0)})
        with pytest.raises(RobotError, match=r"'first': .*are these degrees\?") as told:
            self.load(tmp_path, two_joints(), limits=degrees)
        assert "'robot.limits.position={first: [-1.39626, 1.39626], second: [-1, 1]}'" in str(told.value)
        turning = one_joint(kind="continuous", limit='<limit velocity="1" effort="2"/>')
        assert self.load(tmp_path, turning, limits=Limits(position={"turn": (-80.0, 80.0)})).joints == 1

    def test_higher_limits_are_in_the_digest_where_there_are_any(self, tmp_path):
        bare, same = (self.load(tmp_path, two_joints()) for _ in range(2))
        assert bare.digest == same.digest and bare.higher_limits == {}
        given = [
            Limits(acceleration={"first": 3.0}),
            Limits(acceleration={"first": 3.5}),
            Limits(acceleration={"second": 3.0}),
            Limits(jerk={"first": 3.0}),
            Limits(acceleration={"first": 3.0}, jerk={"first": 3.0}),
        ]
        arms = [self.load(tmp_path, two_joints(), limits=limits) for limits in given]
        assert len({bare.digest, *(arm.digest for arm in arms)}) == 1 + len(given)
        again = self.load(tmp_path, two_joints(), limits=given[-1])
        assert again.digest == arms[-1].digest
        assert list(again.higher_limits) == ["acceleration", "jerk"]
        assert again.higher_limits["jerk"].tolist() == [3, math.inf]
        gentle = with_effort(again, 0.5)
        assert gentle.higher_limits == again.higher_limits and gentle.digest != again.digest

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            (None, r"there is no file robot\.limits_file="),
            ("joint_limits: [1", "is no YAML"),
            ("{}", "has no joint_limits"),
            ("joint_limits: {elbow: {max_velocity: 1}}", "limits elbow, of which .* has none"),
            (
                "joint_limits: {turn: {max_velocity: 0}}",
                "joint 'turn': max_velocity is 0, expected one above 0",
            ),
            ("joint_limits: {turn: {max_velocity: fast}}", "max_velocity is 'fast', expected a number"),
            ("joint_limits: {turn: {min_position: 1, max_position: -1}}", "expected lower < upper"),
        ],
    )
    def test_a_file_that_is_none_is_refused(self, tmp_path, text, message):
        file = tmp_path / "joint_limits.yaml"
        if text is not None:
            file.write_text(text)
        with pytest.raises(RobotError, match=message):
            self.load(tmp_path, one_joint(), limits_file=str(file))

    @pytest.mark.parametrize(
        ("limits", "message"),
        [
            (Limits(velocity={"elbow": 1.0}), "no joint 'elbow' of robot.limits.velocity"),
            (
                Limits(position={"turn": (1.0, 0.0)}),
                "robot.limits.position is 1 to 0, expected lower < upper",
            ),
        ],
    )
    def test_limits_that_are_none_are_refused(self, tmp_path, limits, message):
        with pytest.raises(RobotError, match=message):
            self.load(tmp_path, one_joint(), limits=limits)


SRDF = """<robot name="small">
  <group_state name="ready" group="arm"><joint name="second" value="0.4"/><joint name="first" value="-0.3"/>
  </group_state>
  <group_state name="half" group="arm"><joint name="first" value="-0.3"/></group_state>
  <disable_collisions link1="base" link2="upper" reason="Never"/>
</robot>"""


class TestSemantics:
    def load(self, tmp_path, **settings):
        (tmp_path / "small.urdf").write_text(two_joints())
        (tmp_path / "small.srdf").write_text(SRDF)
        return load_robot(tmp_path / "small.urdf", Setup(srdf=str(tmp_path / "small.srdf"), **settings))

    def test_poses_and_pairs_are_read(self, tmp_path):
        arm = self.load(tmp_path, home="ready")
        assert arm.home == (-0.3, 0.4)
        assert arm.poses == {"ready": (-0.3, 0.4)}
        assert arm.disabled_pairs == (("base", "upper", "Never"),)
        assert self.load(tmp_path).home is None

    @pytest.mark.parametrize(
        ("home", "message"),
        [
            ("stow", "has no pose 'stow'; expected robot.home=ready"),
            ("half", "pose 'half' leaves out second; expected robot.home=ready"),
        ],
    )
    def test_a_pose_that_is_not_there_is_refused(self, tmp_path, home, message):
        with pytest.raises(RobotError, match=message):
            self.load(tmp_path, home=home)

    def test_a_file_that_is_not_there_is_refused(self, tmp_path):
        (tmp_path / "small.urdf").write_text(two_joints())
        with pytest.raises(RobotError, match=r"there is no file robot\.srdf="):
            load_robot(tmp_path / "small.urdf", Setup(srdf=str(tmp_path / "gone.srdf")))

    def test_a_pose_without_a_file_is_refused(self, load, tmp_path):
        load(one_joint())
        with pytest.raises(RobotError, match=r"add robot\.srdf="):
            load_robot(tmp_path / "robot.urdf", Setup(home="ready"))
