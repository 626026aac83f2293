"""Unmodelled effects: planted ones are found with kind and size, and noise is not taken for one."""

import re

import numpy as np
import pytest
from scipy.signal import lfilter

from sidegan.identification import Measurements, estimate
from sidegan.identification.residuals import BIASED, KINDS, find_unmodelled, unmodelled
from tests.identification.recordings import judged, model_of, multisine, truth_of

SAMPLES = 6000
SIZE = 4.0  # [N·m] of a planted misfit
NOISE = 0.5  # [N·m]
NAMES = [f"joint {j + 1}" for j in range(7)]


@pytest.fixture(scope="module")
def model(arm):
    return model_of(arm)


def planted(model, states, amounts):
    """Torque of the model with its true parameters, and misfits of so much of each form, (J, K)."""
    q, dq, _ = states
    torque = model.torque(truth_of(model), *states)
    rigid = model.regressor(*states)[..., : model.rigid] @ truth_of(model)[: model.rigid]
    scale = np.sqrt(np.square(model.torque(truth_of(model), *multisine(model.joints, SAMPLES))).mean(0))
    return torque + np.einsum("sjk,jk->sj", unmodelled(q, dq, rigid, scale), amounts)


def one_each(model):
    """Amounts of a misfit of another kind at every joint, (J, K)."""
    amounts = np.zeros((model.joints, 14))
    for j, forms in enumerate(KINDS.values()):
        amounts[j, list(forms)] = SIZE
    return amounts


def recorded(model, amounts, keep=0.0, moves=1.0):
    states = [moves * x for x in multisine(model.joints, SAMPLES)]
    draw = np.random.default_rng(0).standard_normal(states[0].shape)
    draw[1:] *= (1 - keep**2) ** 0.5
    noise = NOISE * lfilter([1.0], [1.0, -keep], draw, axis=0)
    return Measurements(*states, planted(model, states, amounts) + noise)


@pytest.fixture(scope="module")
def flawed(model):
    """Measurements with a misfit of another kind at every joint, their estimate, and what is found."""
    data = recorded(model, one_each(model))
    fitted = estimate("weighted", model, data)
    return data, fitted, find_unmodelled(model, fitted, data)


def test_each_kind_is_found_at_its_joint_and_nowhere_else(flawed):
    *_, found = flawed
    assert [(misfit.joint, misfit.kind) for misfit in found.found] == [*enumerate(KINDS)]
    assert all(0.2 < misfit.share <= 1 for misfit in found.found)


def test_the_predicted_errors_are_those_of_the_identified_model(model, flawed):
    """Against the plant itself, without noise, at the states where the model is to hold."""
    _, fitted, found = flawed
    states = model.usual_states(seed=5)
    true = planted(model, states, one_each(model))
    actual = np.sqrt(np.square(true - model.torque(fitted.parameters, *states)).mean(0))
    usual = np.sqrt(np.square(model.torque(fitted.parameters, *states)).mean(0))
    np.testing.assert_allclose(found.error, actual / usual, rtol=0.2)


@pytest.mark.parametrize("keep", [0.0, 0.9], ids=["white", "coloured"])
def test_noise_is_not_taken_for_misfit(model, keep):
    data = recorded(model, np.zeros((model.joints, 14)), keep)
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
    data = recorded(model, one_each(model), moves=moves)
    found = find_unmodelled(model, estimate("weighted", model, data), data)
    assert np.isfinite(found.error).all()
    assert {misfit.joint for misfit in found.found} == {0, 1, 3, 4, 5, 6}
