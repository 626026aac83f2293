import math

import numpy as np
import pytest
import torch

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification import (
    Identified,
    Measurements,
    Noise,
    Rls,
    evaluate,
    identify,
    identify_weighted,
    measure,
    nmse,
)
from sidegan.motion.trajectory import Motion


@pytest.fixture
def noisy(body, motion):
    return measure(body, motion, Noise("additive"), np.random.default_rng(0))


@pytest.fixture
def clean(body, motion):
    return measure(body, motion, Noise(level=0.0), np.random.default_rng(0))


def known(parameters):
    p = len(parameters)
    return Identified(
        parameters, torch.eye(p).double(), 1, torch.ones(3).double(), torch.ones(3).double(), 1.0
    )


@pytest.mark.parametrize("method", [identify, identify_weighted])
def test_exact_measurements_give_the_exact_parameters(body, clean, method):
    found = method(body, clean, prior=1e12)
    torch.testing.assert_close(found.parameters, body.base.values, rtol=0, atol=1e-8)
    assert evaluate(body, found, clean).max() < 1e-15


def test_it_is_least_squares_of_the_stacked_samples(body, noisy):
    rows = body.base_regressor(*noisy.states).reshape(-1, 6)
    stacked = torch.cat([rows, 1e-3 * torch.eye(6, dtype=torch.float64)])
    right = torch.cat([noisy.torque.reshape(-1), torch.zeros(6, dtype=torch.float64)])
    expected = torch.linalg.lstsq(stacked, right).solution
    torch.testing.assert_close(identify(body, noisy, prior=1e6).parameters, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("method", [identify, identify_weighted])
@pytest.mark.parametrize("samples", [1, 7, 128, 10_000])
@pytest.mark.parametrize("forgetting", [0.99, 1.0])
def test_a_stream_is_read_once_in_bounded_pieces(body, noisy, method, samples, forgetting):
    whole = method(body, noisy, forgetting=forgetting)
    body.largest = 0
    stream = (noisy[i : i + 50] for i in range(0, 300, 50))
    found = method(body, stream, forgetting=forgetting, samples_at_once=samples)
    assert body.largest == min(samples, 300)
    torch.testing.assert_close(found.parameters, whole.parameters, rtol=1e-9, atol=1e-12)
    torch.testing.assert_close(found.covariance, whole.covariance, rtol=1e-9, atol=0)
    assert found.samples == 300


def test_settings_reach_the_recursion(body, noisy):
    rls = Rls(6, 3, prior=2.0, forgetting=0.9)
    rls.update(body.base_regressor(*noisy.states), noisy.torque)
    found = identify(body, noisy, prior=2.0, forgetting=0.9)
    assert torch.equal(found.parameters, rls.estimate) and torch.equal(found.covariance, rls.covariance)


def test_the_weighted_model_predicts_the_small_joint_better(body, motion, clean):
    noisy = [measure(body, motion, Noise(), np.random.default_rng(seed)) for seed in range(5)]
    plain = evaluate(body, identify(body, noisy), clean)
    weighted = evaluate(body, identify_weighted(body, noisy), clean)
    assert weighted[2] < 0.1 * plain[2]


def test_the_error_is_that_of_the_predicted_torques(body, noisy):
    parameters = body.base.values * 1.1
    expected = nmse(noisy.torque, body.base_regressor(*noisy.states) @ parameters)
    body.largest = 0
    found = evaluate(
        body, known(parameters), (noisy[i : i + 77] for i in range(0, 300, 77)), samples_at_once=50
    )
    torch.testing.assert_close(found, expected, rtol=1e-12, atol=0)
    assert body.largest == 50


def test_more_trajectories_identify_better(body, motion):
    random = np.random.default_rng(0)

    def error(repetitions):
        parts = (measure(body, motion, Noise("additive"), random) for _ in range(repetitions))
        return float((identify_weighted(body, parts).parameters - body.base.values).norm())

    assert np.median([error(32) for _ in range(9)]) < 0.5 * np.median([error(1) for _ in range(9)])


@pytest.mark.parametrize("method", [identify, identify_weighted])
def test_no_samples_are_refused(body, clean, method):
    with pytest.raises(ShapeError, match="no samples"):
        method(body, [])
    with pytest.raises(ShapeError, match="no samples"):
        method(body, clean[:0])


def test_no_test_samples_are_refused(body):
    with pytest.raises(ShapeError, match="no samples"):
        evaluate(body, known(body.base.values), [])


def test_a_model_of_another_arm_is_refused(body, clean):
    with pytest.raises(ShapeError, match="4 parameters, the arm has 6"):
        evaluate(body, known(torch.ones(4, dtype=torch.float64)), clean)


def test_a_test_at_rest_is_refused(body):
    still = torch.ones(20, 3, dtype=torch.float64)
    rest = Measurements(still, 0 * still, 0 * still, body.torque(still, 0 * still, 0 * still))
    with pytest.raises(ShapeError, match=r"joints \[1, 2, 3\] is constant"):
        evaluate(body, known(body.base.values), rest)


@pytest.mark.parametrize(
    "settings", [{"prior": 0.0}, {"prior": math.inf}, {"forgetting": 0.0}, {"samples_at_once": 0}]
)
@pytest.mark.parametrize("method", [identify, identify_weighted])
def test_settings_out_of_range_are_refused(body, clean, method, settings):
    with pytest.raises(ConfigError):
        method(body, clean, **settings)


def test_a_motion_at_rest_leaves_the_rest_at_the_prior(body):
    still = torch.full((1, 50, 3), 0.4, dtype=torch.float64)
    motion = Motion(torch.linspace(0, 1, 50), still, 0 * still, 0 * still)
    found = identify(body, measure(body, motion, Noise(), np.random.default_rng(0)), prior=5.0)
    # Accelerations and speeds are zero: the third and sixth parameter never show.
    assert found.parameters[[2, 5]].abs().max() < 1e-12
    assert found.covariance.diagonal()[[2, 5]].tolist() == pytest.approx([5, 5])
