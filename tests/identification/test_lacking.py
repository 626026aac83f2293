"""What models lack: planted misfits are found by their kind and size, and noise is not taken for one."""

import re

import numpy as np
import pytest
import torch
from scipy.signal import lfilter

from sidegan.design.prediction import lacking
from sidegan.identification import Measurements, estimate
from sidegan.identification.lacking import BIASED, KINDS, lacks
from sidegan.identification.trust import trust
from tests.identification.recordings import at_once, model_of, multisine, truth_of

SAMPLES, JOINT = 6000, 3
SIZE = 4.0  # [N·m] of a planted misfit
NOISE = 0.5  # [N·m]


@pytest.fixture(scope="module")
def model(arm):
    return model_of(arm)


def coloured(shape, keep, seed=0):
    draw = np.random.default_rng(seed).standard_normal(shape)
    draw[1:] *= (1 - keep**2) ** 0.5
    return torch.from_numpy(lfilter([1.0], [1.0, -keep], draw, axis=0))


def planted(model, states, amounts):
    """Torque of the model with its true parameters, and misfits of so much of each form, (J, K)."""
    q, dq, _ = states
    torque = model.torque(truth_of(model), *states)
    rigid = model.regressor(*states)[..., : model.rigid] @ truth_of(model)[: model.rigid]
    scale = model.torque(truth_of(model), *multisine(model.joints, SAMPLES)).square().mean(0).sqrt()
    return torque + torch.einsum("sjk,jk->sj", lacking(q, dq, rigid, scale), amounts)


def amounts_of(model, kind, size=SIZE):
    amounts = torch.zeros(model.joints, 14, dtype=torch.float64)
    amounts[JOINT, list(kind.forms)] = size
    return amounts


def recorded(model, amounts, keep=0.0, seed=0):
    states = multisine(model.joints, SAMPLES)
    noise = NOISE * coloured(states[0].shape, keep, seed)
    return Measurements(*states, planted(model, states, amounts) + noise)


@pytest.mark.parametrize("kind", KINDS, ids=[one.name for one in KINDS])
def test_each_kind_is_found_where_it_is(model, kind):
    data = recorded(model, amounts_of(model, kind))
    found = lacks(model, estimate("weighted", model, data), data)
    assert {one.joint for one in found.found} == {JOINT}
    first = found.of(JOINT)[0]
    assert first.kind == kind and 0.2 < first.share <= 1
    assert [one.share for one in found.of(JOINT)] == sorted(
        (one.share for one in found.of(JOINT)), reverse=True
    )


def test_each_form_is_of_one_kind():
    (forms,) = lacking(*torch.ones(4, 1, dtype=torch.float64)).shape[1:]
    assert sorted(form for kind in KINDS for form in kind.forms) == list(range(forms))


@pytest.mark.parametrize("kind", KINDS[:3], ids=[one.name for one in KINDS[:3]])
def test_the_error_elsewhere_is_that_of_the_identified_model(model, kind):
    """Against the plant itself, without noise, at the states where the model is to hold."""
    data = recorded(model, amounts_of(model, kind))
    fitted = estimate("weighted", model, data)
    states = model.usual_states(seed=5)
    true = planted(model, states, amounts_of(model, kind))
    actual = (true - model.torque(fitted.parameters, *states)).square().mean(0).sqrt()
    usual = model.torque(fitted.parameters, *states).square().mean(0).sqrt()
    told = lacks(model, fitted, data).error
    assert float(told[JOINT]) == pytest.approx(float((actual / usual)[JOINT]), rel=0.4)


@pytest.mark.parametrize("keep", [0.0, 0.9], ids=["white", "coloured"])
def test_noise_is_no_misfit(model, keep):
    for seed in range(4):
        data = recorded(model, torch.zeros(model.joints, 14).double(), keep, seed)
        found = lacks(model, estimate("weighted", model, data), data)
        assert found.found == () and (found.error == 0).all()
    names = [f"joint {j + 1}" for j in range(model.joints)]
    nothing = torch.zeros(model.joints)
    assert found.said(names, nothing) == [
        "no known misfit explains more of it than noise would: more motion helps"
    ]
    assert found.motions(names, nothing) == []


def test_bias_and_noise_are_told_apart_in_words(model):
    kind = KINDS[0]
    data = recorded(model, amounts_of(model, kind))
    fitted = estimate("weighted", model, data)
    found, names = lacks(model, fitted, data), [f"joint {j + 1}" for j in range(model.joints)]
    noise = trust(model, fitted).torque_deviation
    (said,) = found.said(names, noise)
    assert re.match(r"joint 4: \d+% of what is left is friction near rest, ", said)
    assert said.endswith(BIASED) and found.error[JOINT] > noise[JOINT]
    assert found.motions(names, noise)[0] == "slow reversals of joint 4"
    (quiet,) = found.said(names, 100 * noise)
    assert quiet.endswith("noise dominates") and found.motions(names, 100 * noise) == []


def test_samples_in_pieces_say_the_same(model):
    data = recorded(model, amounts_of(model, KINDS[1]))
    fitted = estimate("weighted", model, data)
    whole = lacks(model, fitted, data)
    with at_once(700):
        parts = lacks(model, fitted, data)
    torch.testing.assert_close(parts.error, whole.error, rtol=1e-6, atol=1e-9)
    assert [one[:2] for one in parts.found] == [one[:2] for one in whole.found]


def test_a_joint_that_does_not_move_lacks_nothing(model):
    q, dq, ddq = multisine(model.joints, SAMPLES)
    moves = torch.ones(model.joints).double()
    moves[2] = 0.0
    states = q * moves, dq * moves, ddq * moves
    torque = planted(model, states, amounts_of(model, KINDS[0]))
    data = Measurements(*states, torque + NOISE * coloured(q.shape, 0.0))
    found = lacks(model, estimate("weighted", model, data), data)
    assert found.error.isfinite().all() and found.of(2) == []
    assert found.of(JOINT)[0].kind == KINDS[0]
