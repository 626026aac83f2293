"""Residuals: noise is told by its size above the cut-off, spectrum and order; planted effects are found."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from sidegan.identification import Measurements, estimate
from sidegan.identification.effects import EFFECT_KINDS
from sidegan.identification.identified import measurements_of
from sidegan.identification.residuals import BIASED, find_unmodelled, is_noise
from sidegan.identification.verdict import USABLE
from tests.identification.recordings import (
    VISCOUS,
    checked,
    identified,
    judged,
    model_of,
    multisine,
    planted,
    truth_of,
    white,
)

RATE = 200.0
LOUD = 3.0  # [N·m]: half as much as the elbow's own torque


def noisy(arm, seed, extra=lambda made: 0.0, seconds=30, noise=LOUD):
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
    draw = 3 * LOUD * white((len(made.time),), 9)
    return sosfilt(butter(2, 2.0, fs=RATE, output="sos"), draw)


MISFITS = {
    "cogging": lambda made: 1.5 * np.sin(60 * made.position[:, 1]),
    "cogging that looks white": lambda made: 6 * np.sin(400 * made.position[:, 1]),
    "friction that bends": lambda made: (
        10 * np.sign(made.velocity[:, 1]) * np.abs(made.velocity[:, 1]) ** 0.5
    ),
    "filtered noise": filtered,
    "a spring": lambda made: 2 * np.sin(2 * made.position[:, 1]),
}


@pytest.mark.parametrize("seed", range(0, 6, 2))
def test_white_noise_is_recognised(planar, seed):
    assert called_noise(planar, noisy(planar, seed), noisy(planar, seed + 1)) == [True, True]


@pytest.mark.parametrize("misfit", MISFITS)
def test_unmodelled_effects_are_not_taken_for_noise(planar, misfit):
    training, other = (noisy(planar, seed, MISFITS[misfit]) for seed in (0, 1))
    assert called_noise(planar, training, other) != [True, True]


def test_another_load_is_not_taken_for_noise(planar, heavier):
    assert called_noise(planar, noisy(planar, 0), noisy(heavier, 1)) == [True, False]


def test_a_short_recording_is_inconclusive(planar):
    assert not called_noise(planar, noisy(planar, 0, seconds=4), noisy(planar, 1))[0]


def test_noise_is_unknown_without_a_band_above_the_filter(planar):
    recording = noisy(planar, 0)
    assert called_noise(planar, replace(recording, noise=np.full(2, np.nan)), recording) == [False, True]


def test_a_joint_drowned_in_noise_is_judged_separately(planar):
    training, validation = (noisy(planar, seed, noise=40.0) for seed in (0, 1))
    result = identified(planar, [training], [validation]).quality
    assert result.drowned.tolist() == [False, True] and result.judged.nmse_mean > 0.1
    assert result.verdict == USABLE and result.mean(result.judged) < 0.01
    (said,) = [reason for reason in result.reasons if reason.startswith("joint 2")]
    assert "the residual is noise of" in said and "a longer recording" in said
    strict = replace(result, noise=np.zeros(2, dtype=bool))
    assert strict.verdict == "not trustworthy" and "leaves" in " ".join(strict.reasons)


SAMPLES = 6000
SIZE = 4.0  # [N·m] of a planted misfit
NOISE = 0.5  # [N·m]
NAMES = [f"joint {j + 1}" for j in range(7)]


def one_each(model):
    """A model with an effect of another kind at every joint, and its true parameters."""
    return planted(model, [*enumerate(EFFECT_KINDS)], SIZE)


def recorded(true, parameters, keep=0.0, moves=1.0):
    """Measurements of a model at states, with noise of which a share is kept from sample to sample."""
    states = [moves * x for x in multisine(true.joints, SAMPLES)]
    draw = np.random.default_rng(0).standard_normal(states[0].shape)
    draw[1:] *= (1 - keep**2) ** 0.5
    noise = NOISE * lfilter([1.0], [1.0, -keep], draw, axis=0)
    return Measurements(*states, true.torque(parameters, *states) + noise)


@pytest.fixture(scope="module")
def flawed(model):
    """Measurements with a misfit of another kind at every joint, their estimate, and what is found."""
    data = recorded(*one_each(model))
    fitted = estimate("weighted", model, data)
    return data, fitted, find_unmodelled(model, fitted, data)


def test_each_kind_is_found_at_its_joint_and_nowhere_else(flawed):
    *_, found = flawed
    assert [misfit.joint for misfit in found.found] == [*range(len(EFFECT_KINDS))]
    assert [misfit.kind for misfit in found.found] == [kind.words for kind in EFFECT_KINDS.values()]
    assert all(0.2 < misfit.share <= 1 for misfit in found.found)


def test_the_predicted_errors_are_those_of_the_identified_model(model, flawed):
    """Against the plant itself, without noise, at the states where the model is to hold."""
    _, fitted, found = flawed
    states = model.usual_states(seed=5)
    true, parameters = one_each(model)
    torque, predicted = true.torque(parameters, *states), model.torque(fitted.parameters, *states)
    actual, usual = (np.sqrt(np.square(x).mean(0)) for x in (torque - predicted, predicted))
    np.testing.assert_allclose(found.error, actual / usual, rtol=0.2)


@pytest.mark.parametrize("keep", [0.0, 0.9], ids=["white", "coloured"])
def test_noise_is_not_taken_for_misfit(model, keep):
    data = recorded(model, truth_of(model), keep)
    found = find_unmodelled(model, estimate("weighted", model, data), data)
    assert found.found == () and (found.error == 0).all()
    (words,) = found.sentences(NAMES, np.zeros(model.joints))
    assert words.startswith("no known effect explains more of the residual than noise would")


def test_bias_and_noise_are_reported_separately(model, flawed):
    data, fitted, found = flawed
    noise = judged(model, fitted, data).torque_deviation
    first, *others = found.sentences(NAMES, noise)
    assert re.match(r"joint 1: \d+% of the residual is friction near rest, ", first)
    assert len(others) == 6 and all(said.endswith(BIASED) for said in (first, *others))
    assert (found.error > noise).all()
    assert all(said.endswith("noise dominates") for said in found.sentences(NAMES, 100 * noise))


def test_a_joint_at_rest_shows_no_misfit(model):
    moves = np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    data = recorded(*one_each(model), moves=moves)
    found = find_unmodelled(model, estimate("weighted", model, data), data)
    assert np.isfinite(found.error).all()
    assert {misfit.joint for misfit in found.found} == {0, 1, 3, 4, 5, 6}
