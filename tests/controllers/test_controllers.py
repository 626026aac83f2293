"""What controllers are given is the motion that was checked, between points and slowed down too."""

import io
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml

from sidegan.controllers import SHELL, ExportSettings
from sidegan.controllers.course import Course, least_rate, run_of, slower
from sidegan.controllers.formats import csv_text, goal_text, script_text
from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.recording.load import load_recording
from tests.recording.conftest import of_file

FAMILY = Trajectory(joints=6, harmonics=6, period=16.0, home=(0.1, -0.2, 0.3, 0.0, 0.5, -1.0))
NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist, 3")


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


def test_identify_reads_the_table_without_settings(tmp_path):
    written = course(rate=100)
    table = pd.read_csv(io.StringIO(csv_text(written)))
    table.assign(**{f"tau_{name}": 0.5 for name in NAMES}).to_csv(tmp_path / "a.csv", index=False)
    read = load_recording(tmp_path / "a.csv", of_file(), NAMES)
    for name in ("time", "position", "velocity", "acceleration"):
        np.testing.assert_allclose(getattr(read, name), getattr(written, name), rtol=1e-11, atol=1e-11)


NEAR = 0.05


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
    with pytest.raises(ShapeError, match="must meet"):
        run_of([course(), course(family=Trajectory(joints=6, period=16.0))], 0.0)
