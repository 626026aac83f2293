"""What controllers are given is the motion that was checked; the way to home is within every limit."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from sidegan.controllers import SHELL, ExportSettings, approach
from sidegan.controllers.course import Course, least_rate, run_of, slower
from sidegan.controllers.formats import goal_text, script_text
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane
from tests.chains import random_chain
from tests.refusals import refused
from tests.validity.critical import holding

FAMILY = Trajectory(joints=6, harmonics=6, period=16.0, home=(0.1, -0.2, 0.3, 0.0, 0.5, -1.0))
NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist, 3")
NEAR = 0.05  # [rad]
EXACTLY = 1e8  # Hz, at which a duration is hardly rounded
DENSE = 20_000  # points
HOME = [0.1, -0.4, 0.5, 0.7, -0.3, 0.4, 1.0]
START = [0.6, *HOME[1:]]
BULGE = [-1.2, 0.0], [1.9, 0.0]  # ends of a way through the horizontal, where gravity pulls most
AROUND = [math.pi / 2 - 1, 0.0], [math.pi / 2 + 1, 0.0]
FOLDED = [0.0, 2.0, *[0.0] * 5], [0.0] * 7


def course(seed=0, family=FAMILY, rate=None):
    c = 0.3 * np.random.default_rng(seed).standard_normal((1, *family.shape))
    return Course.of(NAMES, family.roll_out(c, family.times(rate or least_rate(family))))


def test_quintics_between_the_points_reproduce_the_motion():
    fine, drawn = course(rate=100), course().sampled(100)
    for name, most in (("position", 1e-6), ("velocity", 1e-5), ("acceleration", 1e-4)):
        assert np.abs(getattr(drawn, name) - getattr(fine, name)).max() < most


def test_a_slower_family_has_the_same_paths():
    speed = 0.25
    c = np.random.default_rng(0).standard_normal((1, *FAMILY.shape))
    family, slow = slower(FAMILY, c, speed)
    again = family.roll_out(slow, family.times(20 * speed))
    for power, own, other in zip((-1, 0, 1, 2), FAMILY.roll_out(c, FAMILY.times(20)), again):
        np.testing.assert_allclose(other, speed**power * own)


@pytest.mark.parametrize("pause", [0.0, 2.0])
def test_joined_courses_rest_in_between(pause):
    both = run_of([course(0, rate=100), course(1, rate=100)], pause, 100)
    assert both.duration == pytest.approx(2 * FAMILY.period + pause)
    np.testing.assert_allclose(both.time, np.arange(len(both.time)) / 100, rtol=0, atol=1e-9)
    home = np.array(FAMILY.home)
    between = np.abs(both.time - FAMILY.period - pause / 2) <= pause / 2 + 1e-9
    assert between.sum() == int(100 * pause) + 1
    np.testing.assert_allclose(both.position[between] - home, 0, atol=1e-9)


@pytest.fixture(scope="module")
def planned():
    return course()


@pytest.fixture(scope="module")
def text(planned):
    return goal_text(planned, 6 * [NEAR], "locked finger at 0.02 m: it")


@pytest.fixture(scope="module")
def goal(text):
    """The goal as the action server gets it."""
    return yaml.safe_load(text)


def test_the_goal_is_yaml_that_a_shell_can_pass(planned, text, goal):
    assert len(text.encode()) < SHELL and text.startswith("# locked finger")
    assert goal["trajectory"]["joint_names"] == list(NAMES)
    points = goal["trajectory"]["points"]
    for key, states in (("positions", planned.position), ("velocities", planned.velocity)):
        np.testing.assert_allclose([point[key] for point in points], states, rtol=1e-8, atol=1e-9)
    since = [point["time_from_start"] for point in points]
    stamps = [stamp["sec"] + 1e-9 * stamp["nanosec"] for stamp in since]
    np.testing.assert_allclose(stamps, planned.time, rtol=0, atol=1e-9)


def first_command(goal, standing):
    """What a joint trajectory controller commands first to an arm that stands somewhere; None if it aborts.

    ``update`` of joint_trajectory_controller.cpp samples the goal at its start: the first point, if that is
    at time zero, else where the arm is. It commands nothing if a joint is farther from that than its path
    tolerance. A tolerance of zero, which is the usual default, is none, and one in the goal takes its place
    (``get_segment_tolerances``, ``check_state_tolerance_per_joint`` of tolerances.hpp).
    """
    names, first = goal["trajectory"]["joint_names"], goal["trajectory"]["points"][0]
    tolerances = {each["name"]: each["position"] for each in goal.get("path_tolerance", ())}
    at_once = first["time_from_start"] == {"sec": 0, "nanosec": 0}
    desired = np.array(first["positions"] if at_once else standing)
    for name, error in zip(names, np.abs(standing - desired)):
        if 0 < tolerances.get(name, 0.0) < error:
            return None
    return desired


@pytest.mark.parametrize(("off", "refused"), [(0.3, True), (0.051, True), (0.049, False), (0.0, False)])
@pytest.mark.parametrize("joint", [0, 5])
def test_a_goal_does_not_make_an_arm_jump(planned, goal, off, refused, joint):
    standing = planned.position[0].copy()
    standing[joint] -= off
    command = first_command(goal, standing)
    assert command is None if refused else np.abs(command - standing).max() <= NEAR
    bare = {"trajectory": goal["trajectory"]}
    assert np.abs(first_command(bare, standing) - standing).max() == pytest.approx(off)  # as it would without


def test_a_prismatic_joint_has_a_tolerance_in_metres(planar):
    arm = replace(planar, prismatic=np.array([False, True]))
    assert ExportSettings().tolerance.of(arm) == [0.05, 0.01]


class Robot(dict):
    """What a UR controller has for a program, and what that makes of it."""

    def __init__(self, standing):
        self.at, self.sent, self.said = list(standing), [], []

        def servoj(q, a, v, period, lookahead, gain):
            assert (a, v, period) == (0, 0, 0.008) and 0.03 <= lookahead <= 0.2 and 100 <= gain <= 2000
            self.sent.append(list(q))

        super().__init__(
            get_actual_joint_positions=lambda: self.at,
            norm=abs,
            servoj=servoj,
            movej=lambda q, a, v: self.said.append("movej"),
            stopj=lambda a: self.said.append("stopj"),
            popup=lambda text, error, blocking: self.said.append(text),
        )

    def run(self, script):
        """Run a program: but for ``end``, ``halt`` and ``global`` what these use of URScript is Python."""
        lines = [line for line in script.splitlines() if line.strip() != "end"]
        text = re.sub(r"global (\w+) = (.*)", r"globals()['\1'] = \2", "\n".join(lines))
        text = re.sub(r"^( *)halt$", r"\1raise SystemExit", text, flags=re.MULTILINE)
        exec(text, self)


def test_the_program_follows_the_motion_and_settles():
    both = run_of([course(0), course(1)], 1.0)
    script = script_text(both, "excite 1; evil()", NEAR, "locked finger")
    assert script.startswith("def excite_1__evil__():\n  # locked finger\n")
    assert script.endswith("\nexcite_1__evil__()\n") and len(script.splitlines()) < 2 * 121 + 70
    robot = Robot(both.position[0] + 0.9 * NEAR)
    robot.run(script)
    drawn = both.sampled(125).position
    np.testing.assert_allclose(robot.sent[: len(drawn)], drawn, rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.sent[len(drawn) :], drawn[-1:].repeat(len(robot.sent) - len(drawn), 0))
    assert 0.4 < (len(robot.sent) - len(drawn)) * 0.008 < 0.6 and robot.said == ["movej", "stopj"]


def test_the_program_starts_only_at_its_start(planned):
    robot = Robot(planned.position[0] - np.array([0, 0, 0, 0, 1.1 * NEAR, 0]))
    with pytest.raises(SystemExit):
        robot.run(script_text(planned, "excite_1", NEAR))
    assert not robot.sent and "not at the first point" in robot.said[0]


def test_courses_that_do_not_meet_are_refused():
    with refused(ShapeError, "apart"):
        run_of([course(), course(family=Trajectory(joints=6, period=16.0))], 0.0)
    still = course()
    for names in (NAMES[::-1], NAMES[:3]):
        other = Course(names, still.time, *(x[:, : len(names)] for x in still[2:]))
        with refused(ShapeError, *names):
            run_of([still, other], 0.0)


def way(constraints, start, home, **changes):
    """The way, with the usual settings but for these."""
    return approach(constraints, start, home, ExportSettings(**changes))


@pytest.fixture(scope="module")
def desk(arm):
    return Constraints(arm, [Plane(normal=(0, 0, 1), offset=0.1)])


def shares(constraints, course, use):
    """Largest shares of what velocity, acceleration, jerk, and torque beside what holds the arm, may be."""
    arm, body = constraints.arm, constraints.body
    drawn = course.sampled(DENSE / course.duration)
    still = np.zeros_like(drawn.position)
    held = body.torque(drawn.position, still, still)
    moving = body.torque(drawn.position, drawn.velocity, drawn.acceleration) - held
    jerk = np.diff(drawn.acceleration, axis=0) * DENSE / course.duration
    limits = arm.velocity_limit, arm.acceleration_limit, arm.jerk_limit
    states = drawn.velocity, drawn.acceleration, jerk
    found = [(np.abs(x) / (use * most)).max() for x, most in zip(states, limits) if most is not None]
    room = np.minimum(use * arm.torque_limit, arm.torque_limit - held * np.sign(moving))
    return np.stack([*found, (np.abs(moving) / room).max()])


@settings(max_examples=50)
@given(seed=st.integers(0, 10**6), use=st.sampled_from([0.1, 1.0]), tight=st.integers(0, 3))
def test_the_approach_reaches_one_limit_and_exceeds_none(seed, use, tight):
    arm, _ = random_chain(1 + seed % 4, seed)
    start, home = np.random.default_rng(seed).uniform(arm.position_lower, arm.position_upper, (2, arm.joints))
    path = np.linspace(start, home, 2000)
    held = np.abs(RigidBody(arm).torque(path, 0 * path, 0 * path)).max(0)
    tightened = [1e-3 if k == tight else 1.0 for k in range(4)]  # most often the one that decides
    arm = replace(
        arm,
        velocity_limit=tightened[0] * arm.velocity_limit,
        acceleration_limit=tightened[1] * np.full_like(held, 50.0),
        jerk_limit=tightened[2] * np.full_like(held, 1e4),
        torque_limit=held + tightened[3] * np.maximum(300 - held, 50) + 0.002 * held,
    )
    try:
        constraints = Constraints(arm)
        course = way(constraints, start.tolist(), home.tolist(), careful=use, rate=EXACTLY, longest=1e9)
    except InfeasibleError:
        reject()
    assert course.position[0].tolist() == start.tolist() and course.position[-1].tolist() == home.tolist()
    assert not course.velocity[[0, -1]].any() and not course.acceleration[[0, -1]].any()
    found = shares(constraints, course, use)
    assert found.max() < 1 + 1e-6
    if course.duration < 0.5 + 1e-6:  # the shortest, within all limits
        return
    precision = 1e-3 if found.argmax() == 2 else 1e-6  # a jerk is a difference
    assert found.max() > 1 - precision


def test_the_approach_has_a_row_per_tick_and_obeys_the_speed(desk):
    once = way(desk, START, [0.0] * 7)
    assert (once.duration * 100) % 1 == pytest.approx(0) and once.duration > 0.5
    rows = once.sampled(100.0).time
    np.testing.assert_allclose(rows, np.arange(len(rows)) / 100, rtol=0, atol=1e-12)
    slow = way(desk, START, [0.0] * 7, speed=0.05)
    assert slow.duration == pytest.approx(20 * once.duration, abs=0.2 + 0.01)
    assert np.abs(slow.velocity).max() == pytest.approx(0.05 * np.abs(once.velocity).max(), rel=0.01)
    coarse = way(desk, START, [0.0] * 7, rate=8.0)
    assert coarse.duration >= 20 / 8  # of which there are enough to follow it


def test_an_arm_that_is_at_home_rests_there_for_the_shortest_time(desk):
    course = way(desk, HOME, HOME)
    assert course.duration == 0.5 and not course.velocity.any() and not course.acceleration.any()
    np.testing.assert_allclose(course.position - HOME, 0, atol=1e-15)


@pytest.mark.parametrize("share", [0.34, 0.9])
@pytest.mark.parametrize("use", [0.05, 0.2, 1.0])
def test_high_holding_torque_along_the_way_is_accepted(planar, share, use):
    constraints = Constraints(holding(planar, share))
    course = way(constraints, *BULGE, careful=use)
    assert shares(constraints, course, use)[-1] <= 1


@pytest.mark.parametrize(
    ("names", "make", "ends"),
    [
        (["keep_out of", "controllers.start"], None, FOLDED),
        (
            ["torque of shoulder"],
            lambda arm: replace(arm, torque_limit=0.01 * arm.torque_limit),
            ([0.0, 0.0], [0.9, 0.9]),
        ),
        (["shoulder", "99.9%", "effort=…"], lambda arm: holding(arm, 0.9992), AROUND),
        (
            ["elbow", "803", "{'careful': …} below 0.2", "effort=…"],
            lambda arm: replace(arm, drives=replace(arm.known_drives, viscous=np.full(2, 1000.0))),
            ([0, 0], [2, 0]),
        ),
        (
            ["0.1% of the limits of shoulder", "'longest': 1251"],
            lambda arm: arm,
            ([0, 0], [2, 0], {"careful": 0.001}),
        ),
        (
            ["84", "20% of the limits of elbow", "controllers={'longest': 84"],
            lambda arm: replace(arm, velocity_limit=np.array([3.0, 0.001])),
            ([0, 0], [0, 0.9]),
        ),
    ],
)
def test_an_impossible_approach_is_refused(planar, desk, names, make, ends):
    with refused(InfeasibleError, *names):
        start, home, *changes = ends
        way(Constraints(make(planar)) if make else desk, start, home, **dict(*changes))
