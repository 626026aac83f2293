"""What controllers are given is the motion that was checked, between points and slowed down too."""

import io
import re

import numpy as np
import pandas as pd
import pytest
import torch
import yaml

from sidegan.controllers.course import Course, knots, run_of, slower
from sidegan.controllers.ros2 import goal_text
from sidegan.controllers.table import csv_text
from sidegan.controllers.urscript import script_text
from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.recording.load import load_recording
from tests.recording.conftest import of_file

FAMILY = Trajectory(joints=6, harmonics=6, period=16.0, home=(0.1, -0.2, 0.3, 0.0, 0.5, -1.0))
NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist, 3")
MOST = 128 * 1024  # bytes of one argument of a command on Linux


def course(seed=0, family=FAMILY, rate=None):
    c = 0.3 * torch.randn(
        1, *family.shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64
    )
    times = knots(family) if rate is None else family.times(rate)
    return Course.of(NAMES, family.roll_out(c, times))


def test_quintics_between_the_points_are_the_motion():
    fine, drawn = course(rate=100), course().sampled(100)
    for name, most in (("position", 1e-6), ("velocity", 1e-5), ("acceleration", 1e-4)):
        assert (getattr(drawn, name) - getattr(fine, name)).abs().max() < most
    assert len(course().sampled(1e-3).time) == 21  # of a short way enough to follow it


@pytest.mark.parametrize("speed", [0.25, 0.5, 1.0])
def test_a_slower_family_has_the_same_paths(speed):
    c = torch.randn(1, *FAMILY.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    family, slow = slower(FAMILY, c, speed)
    again = family.roll_out(slow, family.times(20 * speed))
    for power, one, other in zip((-1, 0, 1, 2), FAMILY.roll_out(c, FAMILY.times(20)), again):
        torch.testing.assert_close(other, speed**power * one)


@pytest.mark.parametrize("pause", [0.0, 2.0])
def test_courses_in_a_row_rest_between(pause):
    both = run_of([course(0), course(1)], pause)
    assert both.duration == pytest.approx(2 * FAMILY.period + pause)
    drawn, home = both.sampled(10), torch.tensor(FAMILY.home, dtype=torch.float64)
    between = (drawn.time - FAMILY.period - pause / 2).abs() <= pause / 2 + 1e-9
    torch.testing.assert_close(
        drawn.position[between], home.expand(int(10 * pause) + 1, -1), rtol=0, atol=1e-9
    )


def test_identify_reads_the_table_without_a_setting(tmp_path):
    one = course(rate=100)
    table = pd.read_csv(io.StringIO(csv_text(one)))
    table.assign(**{f"tau_{name}": 0.5 for name in NAMES}).to_csv(tmp_path / "a.csv", index=False)
    read = load_recording(tmp_path / "a.csv", of_file(), NAMES)
    for name in ("time", "position", "velocity", "acceleration"):
        torch.testing.assert_close(getattr(read, name), getattr(one, name), rtol=1e-8, atol=1e-8)


def test_the_goal_is_yaml_that_a_shell_can_pass():
    one = course()
    text = goal_text(one)
    assert len(text.encode()) < MOST
    goal = yaml.safe_load(text)["trajectory"]
    assert goal["joint_names"] == list(NAMES)
    for key, wanted in (("positions", one.position), ("velocities", one.velocity)):
        found = np.array([point[key] for point in goal["points"]])
        np.testing.assert_allclose(found, wanted.numpy(), rtol=1e-8, atol=1e-9)
    stamps = [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in goal["points"]]
    np.testing.assert_allclose(stamps, one.time.numpy(), rtol=0, atol=1e-9)


def test_the_program_follows_the_motion_and_starts_nowhere_else():
    fine, text = course(rate=125), script_text(course(), "excite 1; evil()")
    assert text.startswith("def excite_1__evil__():") and text.endswith("excite_1__evil__()\n")
    served = [
        [float(x) for x in match.split(",")]
        for match in re.findall(r"servoj\(\[([^]]*)\], 0, 0, 0\.008", text)
    ]
    np.testing.assert_allclose(served, fine.position.numpy(), rtol=0, atol=1e-6)
    assert text.index("popup") < text.index("movej") < text.index("servoj")


def test_courses_that_do_not_meet_are_refused():
    with pytest.raises(ShapeError, match="must meet"):
        course().then(course(family=Trajectory(joints=6, period=16.0)))
