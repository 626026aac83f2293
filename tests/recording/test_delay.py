"""The delay of torques, against torques that are late by a known time and a wrong description."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.check import check_recording
from sidegan.recording.delay import Delay, delay_of
from tests.recording.conftest import of_file
from tests.recording.made import moved


def late(arm, delay, noise=0.02, seconds=30):
    """A recording at 200 Hz whose torque is that of some time before."""
    time = np.arange(seconds * 200) / 200
    first, second = (
        moved(arm, t, 2.0, 1.0, torch.Generator().manual_seed(3), noise=noise) for t in (time, time - delay)
    )
    return replace(first, torque=second.torque)


@pytest.mark.parametrize("delay", [-0.02, 0.0, 0.003, 0.03])
def test_a_delay_is_found_within_its_deviation(planar, delay):
    wrong = replace(planar, inertial_parameters=1.7 * planar.inertial_parameters)
    checked = check_recording(late(planar, delay), planar, of_file())
    found = delay_of(RigidBody(wrong), checked.segments)
    assert found.seconds == pytest.approx(delay, abs=4 * found.deviation + 0.02 * abs(delay))
    assert found.deviation < 1e-3 and found.believed == (delay != 0)


def test_a_measured_delay_is_taken_off(planar):
    recording = late(planar, 0.02)
    left = check_recording(recording, planar, of_file())
    better = check_recording(recording, planar, of_file(delay=None))
    given = check_recording(recording, planar, of_file(delay=0.02))
    assert given.delay is None and better.delay.believed and better.corrected and not left.corrected
    assert "recording.delay=null takes it off" in left.statements[-1]
    assert "taken off" in better.statements[-1] and "20 ms later" in given.statements[-1]
    assert given.lag == 0.02
    off = [abs(delay_of(RigidBody(planar), checked.segments).seconds) for checked in (left, better, given)]
    assert off[0] > 0.015 and off[1] < 5e-4 and off[2] < 1e-3


def test_what_cannot_be_told_is_left_as_it_is(planar):
    checked = check_recording(late(planar, 0.0, noise=30.0, seconds=10), planar, of_file(delay=None))
    assert not checked.delay.believed and "left as it is" in "; ".join(checked.statements)


def test_a_delay_is_believed_beyond_its_errors_and_within_the_search():
    """At a tenth of a second the search was stopped: the torques are not late by just that."""
    assert all(Delay(seconds, 1e-4).believed for seconds in (0.099, 4e-4))
    assert not any(Delay(seconds, 1e-4).believed for seconds in (0.1, -0.1, 2e-4))
