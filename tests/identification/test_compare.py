"""Two identifications compared: chance is told from change, and how much torque it makes."""

import pytest
import torch

from sidegan.errors import ShapeError
from sidegan.identification import Measurements, estimate
from sidegan.identification.compare import compare
from sidegan.identification.model import states_within
from tests.identification.recordings import model_of, multisine, parameters_of, recorded, truth_of

NOISE = 0.3


def found(model, seed, parameters=None):
    data = recorded(model, 1000, NOISE, seed)
    if parameters is not None:
        states = multisine(model.joints, 1000, seed)
        data = Measurements(*states, data.torque + model.torque(parameters - truth_of(model), *states))
    one = estimate("weighted", model, data)
    return one.parameters, one.covariance


def test_chance_is_no_difference(planar):
    """Over pairs of recordings of one arm, probabilities are not small and spread."""
    model = model_of(planar)
    told = [compare(model, found(model, seed), found(model, seed + 100)) for seed in range(12)]
    assert not any(one.differ for one in told) and not any(one.clear for one in told)
    assert min(one.probability for one in told) > 1e-3 and max(one.probability for one in told) > 0.5


def test_a_change_is_told_with_its_size_and_what_it_is_worth(planar):
    model = model_of(planar)
    changed = truth_of(model).clone()
    k = model.names.index("fc2")
    changed[k] += 0.4
    result = compare(model, found(model, 0), found(model, 1, changed))
    name, difference, sigma = result.clear[0]
    assert result.differ and name == "fc2" and abs(difference - 0.4) < 4 * sigma
    q, dq, ddq = states_within(planar, 400, seed=2)
    y = model.regressor(q, 0.5 * dq, 0.5 * ddq)
    exact = (y[:, 1, k] * 0.4).square().mean().sqrt() / (y[:, 1] @ truth_of(model)).square().mean().sqrt()
    assert float(result.torque[1]) == pytest.approx(float(exact), abs=4 * float(result.uncertain[1]))


def test_an_estimate_of_another_model_is_refused(planar):
    model = model_of(planar)
    with pytest.raises(ShapeError, match=r"estimates of .* parameters are expected"):
        compare(model, found(model, 0), (parameters_of(model, {})[:3], torch.eye(3).double()))
