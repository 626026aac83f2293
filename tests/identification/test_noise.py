"""Noise is distinguished from unmodelled effects by its size above the cut-off, spectrum and order."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from sidegan.identification import estimate
from sidegan.identification.identified import measurements_of
from sidegan.identification.residuals import is_noise
from sidegan.identification.verdict import USABLE
from tests.identification.recordings import VISCOUS, checked, identified, model_of, white

RATE = 200.0
NOISE = 3.0  # [N·m]: half as much as the elbow's own torque


def recorded(arm, seed, extra=lambda made: 0.0, seconds=30, noise=NOISE):
    """A recording with white noise on the elbow's torque, and more on it."""

    def disturbed(made):
        torque = made.torque.copy()
        torque[:, 1] += noise * white((len(made.time),), seed) + extra(made)
        return replace(made, torque=torque)

    return checked(arm, seed, None, disturbed, seconds, RATE, (VISCOUS, 0.0), noise=0.005)


def called_noise(planar, training, other):
    """Whether what is left of the elbow's torque is called noise, in both recordings."""
    model = model_of(planar)
    found = estimate("weighted", model, measurements_of([training]))
    each = [is_noise(model, found.parameters, found.covariance, [part]) for part in (training, other)]
    return [bool(joints[1]) for joints in each]


def filtered(made):
    """Noise as large below the cut-off and less above it: what a driver's filter leaves, or anything else."""
    draw = 3 * NOISE * white((len(made.time),), 9)
    return sosfilt(butter(2, 2.0, fs=RATE, output="sos"), draw)


MISFITS = {
    "cogging": lambda made: 1.5 * np.sin(60 * made.position[:, 1]),
    "cogging that looks white": lambda made: 6 * np.sin(400 * made.position[:, 1]),
    "friction that bends": lambda made: (
        10 * np.sqrt(np.abs(made.velocity[:, 1])) * np.sign(made.velocity[:, 1])
    ),
    "filtered noise": filtered,
    "a spring": lambda made: 2 * np.sin(2 * made.position[:, 1]),
}


@pytest.mark.parametrize("seed", range(0, 6, 2))
def test_white_noise_is_recognised(planar, seed):
    assert called_noise(planar, recorded(planar, seed), recorded(planar, seed + 1)) == [True, True]


@pytest.mark.parametrize("misfit", MISFITS)
def test_unmodelled_effects_are_not_taken_for_noise(planar, misfit):
    training, other = (recorded(planar, seed, MISFITS[misfit]) for seed in (0, 1))
    assert called_noise(planar, training, other) != [True, True]


def test_another_load_is_not_taken_for_noise(planar):
    heavier = planar.inertial_parameters.copy()
    heavier[1, :2] += 1.0  # [kg, kg·m]
    carrying = recorded(replace(planar, inertial_parameters=heavier), 1)
    assert called_noise(planar, recorded(planar, 0), carrying) == [True, False]


def test_a_short_recording_is_inconclusive(planar):
    assert not called_noise(planar, recorded(planar, 0, seconds=4), recorded(planar, 1))[0]


def test_noise_is_unknown_without_a_band_above_the_filter(planar):
    recording = recorded(planar, 0)
    assert called_noise(planar, replace(recording, noise=np.full(2, np.nan)), recording) == [False, True]


def test_a_joint_drowned_in_noise_is_judged_separately(planar):
    training, validation = (recorded(planar, seed, noise=40.0) for seed in (0, 1))
    result = identified(planar, [training], [validation]).quality
    assert result.drowned.tolist() == [False, True] and result.judged.nmse_mean > 0.1
    assert result.verdict == USABLE and result.mean(result.judged) < 0.01
    (said,) = [reason for reason in result.reasons if reason.startswith("joint 2")]
    assert "the residual is noise of" in said and "a longer recording" in said
    strict = replace(result, noise=np.zeros(2, dtype=bool))
    assert strict.verdict == "not trustworthy" and "leaves" in " ".join(strict.reasons)
