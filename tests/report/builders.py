"""Coefficients, and an identified arm, to report on."""

from dataclasses import replace

import numpy as np

from sidegan.recording.check import check_recording
from tests.identification.test_workflow import COULOMB, VISCOUS, identified
from tests.recording.conftest import moved, of_file


def some(family, count):
    """Coefficients [rad/s], (count, J, H, 2)."""
    source = np.random.default_rng(count)
    return 0.3 * source.standard_normal((count, *family.shape))


def checked(arm, seed, name, seconds=15, rate=50):
    """A recording of an arm under a name, checked, with a gap in the middle."""
    time, generator = np.arange(seconds * rate) / rate, np.random.default_rng(seed)
    time[len(time) // 2 :] += 1.0
    recording = moved(arm, time, VISCOUS[: arm.joints], COULOMB[: arm.joints], generator)
    return check_recording(replace(recording, name=name), arm, of_file())


def identification(arm, first="a.csv", other="b.csv"):
    """An arm that is identified from one recording and validated on another."""
    training, validation = checked(arm, 0, first), checked(arm, 1, other)
    return identified(arm, [training], [replace(validation, role="validation")])
