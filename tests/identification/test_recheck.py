"""A model that is still right, and each change that is told, against Pinocchio's torques."""

import numpy as np
import pytest
import torch

from sidegan.identification import Measurements, estimate, score
from sidegan.identification.recheck import CHANGED, RIGHT, WRONG, expected_error, possible_changes, recheck
from sidegan.identification.score import worst
from tests.identification.recordings import model_of
from tests.identification.test_payload import load, runs  # noqa: F401

NOISE = 0.3


@pytest.fixture(scope="module")
def known(arm):
    """A model, its parameters, their covariance, and its errors on what was held out, (J,)."""
    model, nothing = model_of(arm), np.zeros(10)
    found = estimate("weighted", model, [runs(arm, nothing, 0, NOISE)])
    before = score(model, found.parameters, [runs(arm, nothing, 1, NOISE)]).rmse
    return model, found.parameters, found.covariance, before


def today(arm, seed=7, change=0.0, **options):
    """A fresh recording with torques that changed."""
    data = runs(arm, options.pop("load", np.zeros(10)), seed, NOISE, **options)
    return Measurements(*data.states, data.torque + change)


def test_the_worst_stretch_counts(arm, known):
    """Of recordings in stretches of 100 samples and more, one of which is off at joint 3."""
    model, parameters, *_ = known
    data = today(arm)
    off = torch.zeros_like(data.torque)
    off[200:300, 2] = 5.0
    long = Measurements(*data.states, data.torque + off)[:430]
    found = worst(model, parameters, [data[:50], long], 100)
    stretches = [data[:50], *(long[a:b] for a, b in ((0, 107), (107, 215), (215, 322), (322, 430)))]
    errors = torch.stack([score(model, parameters, [one]).rmse for one in stretches])
    torch.testing.assert_close(found, errors.amax(0))
    assert found[2] > 4 and found[2] == errors[3, 2] and (found[[0, 1, 3, 4, 5, 6]] < 0.5).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_mean_over_fewer_repetitions_may_have_more_noise(arm, known, seed):
    """Identified from means over four executions, judged by one."""
    model, found, covariance, _ = known
    mean = runs(arm, np.zeros(10), 1, NOISE / 2)
    before = worst(model, found, [mean], len(mean))
    fresh = [today(arm, 20 + seed)]
    assert recheck(model, found, covariance, before, fresh).verdict == WRONG
    assert recheck(model, found, covariance, expected_error(before, 4, 1), fresh).verdict == RIGHT
    torch.testing.assert_close(expected_error(before, 1, 4), before)


@pytest.mark.parametrize("seed", range(5))
def test_an_arm_that_is_as_it_was(arm, known, seed):
    result = recheck(*known, [today(arm, 20 + seed)])
    assert result.verdict == RIGHT and result.change is None
    assert len(result.reasons) == 1 and "no change" in result.reasons[0]


def test_more_friction_is_told_with_its_joint(arm, known):
    data = today(arm)
    extra = torch.zeros_like(data.velocity)
    extra[:, 2] = 0.8 * torch.tanh(data.velocity[:, 2] / known[0].terms.sign_width)
    result = recheck(*known, [Measurements(*data.states, data.torque + extra)])
    assert result.verdict == CHANGED and result.change.what == "friction"
    (name, value, sigma), *others = sorted(result.change.clear, key=lambda one: -abs(one[1] / one[2]))
    assert name == "coulomb of joint_3" and abs(value - 0.8) < 4 * sigma and not others
    assert "friction changed: coulomb of joint_3" in "; ".join(result.reasons)


def test_what_is_within_the_limits_is_still_right_but_told(arm, known):
    """Friction that grew by less than the errors at the identification."""
    data = today(arm)
    extra = torch.zeros_like(data.velocity)
    extra[:, 2] = 0.25 * torch.tanh(data.velocity[:, 2] / known[0].terms.sign_width)
    result = recheck(*known, [Measurements(*data.states, data.torque + extra)])
    assert (result.ratio < 1.5).all() and result.change.what == "friction"
    assert result.verdict == RIGHT and "times its largest error" in result.reasons[0]
    words = "still right, though friction looks different by coulomb of joint_3 +0.2"
    assert result.statement.startswith(words)


def test_what_was_never_certain_has_not_changed(arm, known):
    """By models of few noisy samples an arm that is as it was differs by about a deviation."""
    model, data, sure, unsure = known[0], [today(arm)], [], []
    for seed in range(30, 42):
        found = estimate("weighted", model, [runs(arm, np.zeros(10), seed, 3.0, 150)])
        for covariance, ratios in ((found.covariance, unsure), (0 * found.covariance, sure)):
            changes = possible_changes(model, found.parameters, covariance, data)
            ratios += [change.values / change.deviation for change in changes]
    sure, unsure = (torch.cat(ratios).square().mean().sqrt() for ratios in (sure, unsure))
    assert 0.5 < unsure < 1.5 and sure > 2


def test_evidence_is_the_bayesian_information_criterion_of_white_residuals(arm, known):
    """2 n ln(σ₀/σ₁) − k ln N, where the residuals' inflation, which takes samples away, is one."""
    drift = torch.tensor([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    data = today(arm, change=drift)
    change = recheck(*known, [data]).change
    ratio = score(known[0], known[1], [data]).rmse / change.left
    total = torch.tensor(float(data.torque.numel()))
    criterion = 2 * len(data) * float(ratio.log().sum()) - 7 * float(total.log())
    assert change.evidence == pytest.approx(criterion, rel=0.3)


def test_a_drift_of_an_offset_is_told(arm, known):
    drift = torch.tensor([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    result = recheck(*known, [today(arm, change=drift)])
    assert result.verdict == CHANGED and result.change.what == "offsets"
    assert [name for name, *_ in result.change.clear] == ["offset of joint_4"]


def test_another_tool_is_told_with_its_mass(arm, known, load):  # noqa: F811
    result = recheck(*known, [today(arm, load=load)])
    assert result.verdict == CHANGED and result.change.what == "load"
    name, value, sigma = result.change.clear[0]
    assert name == "mass [kg]" and abs(value - load[0]) < 4 * sigma


def test_another_arm_is_not_explained_away(arm, known):
    data = today(arm)
    strange = Measurements(*data.states, 1.5 * data.torque)
    result = recheck(*known, [strange])
    assert result.verdict == WRONG and "identify the arm anew" in result.reasons[-1]
    assert any(reason.startswith("joint_2: ") for reason in result.reasons)
