"""Commanded trajectories are found in recordings of a simulated arm that executed them."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from sidegan.controllers.course import Course
from sidegan.controllers.formats import csv_text
from sidegan.errors import RecordingError
from sidegan.motion.trajectory import Trajectory
from sidegan.plant import IDEAL, Plant
from sidegan.recording.commanded import average_repetitions, load_commanded
from sidegan.recording.recording import Recording
from tests.recording.conftest import check
from tests.refusals import refused

FAMILY = Trajectory(2, harmonics=4, period=8.0)
NOISE, RATE = 0.2, 200.0
COEFFICIENTS = 0.11 * np.random.default_rng(1).standard_normal((3, 2, 4, 2))
PAUSE = 3.1237  # [s] before each, no whole number of samples


@pytest.fixture(scope="module")
def sent(planar, tmp_path_factory):
    """Folder of three tables as excite writes them."""
    folder = tmp_path_factory.mktemp("run") / "trajectories"
    folder.mkdir()
    for k, c in enumerate(COEFFICIENTS):
        course = Course.of(planar.joint_names, FAMILY.roll_out(c[None], FAMILY.times(100)))
        (folder / f"{k + 1}.csv").write_text(csv_text(course))
    (folder / "all.csv").write_text("not,of,interest")
    return folder.parent


@pytest.fixture(scope="module")
def true(planar):
    """The motions that the servos made of them, without sensor noise."""
    settings = replace(IDEAL, rate=1000.0, viscous=[1.0], coulomb=[0.5], feed_forward=0.5)
    plant, times = Plant(planar, settings), FAMILY.times(settings.rate)
    return [plant.follow(FAMILY.roll_out(c[None], times)) for c in COEFFICIENTS]


def logged(planar, true, order, delay=0.0, gap=None):
    """A recording in which trajectories come in some order, with rest before each and late torques."""
    begins = [PAUSE + n * (PAUSE + FAMILY.period) for n in range(len(order))]
    time = np.arange(0, begins[-1] + FAMILY.period + PAUSE, 1 / RATE)
    knots = np.concatenate([true[k].time + begin for k, begin in zip(order, begins)])

    def at(times, name):
        known = np.concatenate([getattr(true[k], name) for k in order])
        return np.stack([np.interp(times, knots, x) for x in known.T], 1)

    q, tau = at(time, "position"), at(time - delay, "torque")
    tau += NOISE * np.random.default_rng(0).standard_normal(tau.shape)
    keep = np.ones(len(time), bool) if gap is None else (time < gap) | (time > gap + 0.3)
    time, q, tau = (x[keep] for x in (time, q, tau))
    return Recording("log", planar.joint_names, time, q, torque=tau), begins


def test_repetitions_are_found_and_averaged(planar, true, sent):
    recording, begins = logged(planar, true, (0, 1, 0, 2, 1, 0))
    parts, repeated = average_repetitions(recording, load_commanded(sent, planar.joint_names, np.eye(2)), 0.1)
    assert repeated.counts == {"1": 3, "2": 2, "3": 1}
    found = [float(part.time[0]) for part in parts]
    assert found == pytest.approx([begins[k] for k in (0, 1, 3)], abs=0.05)  # servos are late by some ms
    np.testing.assert_allclose(repeated.noise, NOISE, rtol=0.1)
    assert repeated.bandwidth == pytest.approx(FAMILY.harmonics / FAMILY.period, rel=0.3)
    clean = np.stack([np.interp(parts[0].time, true[0].time + begins[0], x) for x in true[0].torque.T], 1)
    error = (parts[0].torque - clean)[100:-100].std()
    assert 0.7 < error / (NOISE / 3**0.5) < 1.05  # interpolation takes some of it off, too


def test_a_repetition_with_a_gap_is_not_counted(planar, true, sent):
    recording, begins = logged(planar, true, (0, 1, 0), gap=PAUSE + 4)
    parts, repeated = average_repetitions(recording, load_commanded(sent, planar.joint_names, np.eye(2)), 0.1)
    assert repeated.counts == {"1": 1, "2": 1} and repeated.noise is None
    assert float(parts[-1].time[0]) == pytest.approx(begins[2], abs=0.05)


@pytest.mark.parametrize("delay", [0.0, 0.006, -0.004])
def test_delay_noise_and_bandwidth_are_reported(planar, true, sent, delay):
    recording, _ = logged(planar, true, (0, 1, 2) * 3, delay)
    checked = check(recording, sent=str(sent), delay=None)
    assert checked.delay.seconds == pytest.approx(delay, abs=max(4 * checked.delay.deviation, 1e-3))
    assert checked.delay.deviation < 1.5e-3
    assert checked.grid.source == "of the commands"
    said = "; ".join(checked.statements)
    assert "found the commanded trajectories: 1 × 3, 2 × 3, 3 × 3" in said
    assert "± " in said and "are -" not in said
    assert ("earlier" if checked.delay.seconds < 0 else "later") + " than the motion" in said
    assert len(checked.segments) == 3 and checked.as_json()["repetitions"] == {"1": 3, "2": 3, "3": 3}


def test_the_only_run_in_a_folder_is_used_and_of_several_none(planar, sent, tmp_path):
    first, second = (tmp_path / name / "trajectories" for name in ("a day", "another"))
    first.mkdir(parents=True)
    shutil.copy(sent / "trajectories" / "2.csv", first / "1.csv")
    (found,) = load_commanded(tmp_path, planar.joint_names, np.eye(2))
    np.testing.assert_array_equal(
        found.position, load_commanded(sent, planar.joint_names, np.eye(2))[1].position
    )
    shutil.copytree(first, second)
    ways = f'recording.sent="{tmp_path / "a day"}"', f"recording.sent={tmp_path / 'another'}"
    with refused(RecordingError, "2 runs", *ways):
        load_commanded(tmp_path, planar.joint_names, np.eye(2))


def test_missing_or_foreign_commands_are_refused(planar, true, sent, tmp_path):
    recording, _ = logged(planar, true, (0, 1))
    trajectories = load_commanded(sent, planar.joint_names, np.eye(2))
    slow = [replace(trajectory, time=2 * trajectory.time) for trajectory in trajectories]
    for commands in (trajectories[2:], slow):
        with refused(RecordingError, "log", "recording.sent"):
            average_repetitions(recording, commands, 0.1)
    (tmp_path / "nothing").mkdir()
    (tmp_path / "1.csv").write_text("time,q_elbow\n0.0,0.0\n1.0,1.0\n")
    for path, about in ((tmp_path / "nothing", "recording.sent"), (tmp_path / "1.csv", "q_shoulder")):
        with refused(RecordingError, str(path), about):
            load_commanded(path, planar.joint_names, np.eye(2))


@pytest.mark.parametrize("times", [[0.0], [0.0, 1.0, 1.0], [1.0, 0.0], [0.0, np.nan]])
def test_a_table_without_increasing_times_is_refused(planar, tmp_path, times):
    rows = "".join(f"{time},{k},0\n" for k, time in enumerate(times))
    (tmp_path / "1.csv").write_text(f"time,q_shoulder,q_elbow\n{rows}")
    with refused(RecordingError, "1.csv", "increasing times"):
        load_commanded(tmp_path / "1.csv", planar.joint_names, np.eye(2))


def test_the_times_of_a_table_may_begin_anywhere(planar, sent, tmp_path):
    table = pd.read_csv(sent / "trajectories" / "1.csv")
    table.assign(time=table.time + 3).to_csv(tmp_path / "1.csv")
    (late,) = load_commanded(tmp_path / "1.csv", planar.joint_names, np.eye(2))
    (first, *_) = load_commanded(sent, planar.joint_names, np.eye(2))
    np.testing.assert_allclose(late.time, first.time, atol=1e-12)
