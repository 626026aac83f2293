"""Simulated measurements of the built-in arms, identified and tested on motions that were not seen."""

from dataclasses import replace

import pytest
import torch

from sidegan.identification import RIGID, TorqueModel, estimate, measure, score
from sidegan.identification.fit import recursive
from sidegan.identification.gather import gather
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory, concatenate
from sidegan.robot import load_robot
from tests.identification.recordings import NOISE, Fixed, at_once


@pytest.fixture(scope="module", params=["planar2", "kuka_lwr4"])
def model(request):
    return TorqueModel(RigidBody(load_robot(request.param)), RIGID)


def motions(model, count, seed, scale=0.5):
    """Random trajectories of 8 s at 50 Hz."""
    trajectory = Trajectory(model.joints, period=8.0)
    random = torch.Generator().manual_seed(seed)
    c = torch.randn(count, *trajectory.shape, generator=random, dtype=torch.float64) * scale
    return trajectory.roll_out(c, trajectory.times(50.0))


@pytest.fixture(scope="module")
def noisy(model):
    return measure(model.body, motions(model, 10, seed=1), NOISE, 0)


@pytest.fixture(scope="module")
def clean(model):
    return measure(model.body, motions(model, 10, seed=1))


@pytest.fixture(scope="module")
def unseen(model):
    return measure(model.body, motions(model, 5, seed=2))


def norm(model, data, prior=1e6):
    gathered = gather(model, data)
    return float(recursive(gathered.sums, gathered.samples, prior).inverse.diagonal().norm())


@pytest.mark.parametrize("method", ["ols", "weighted"])
def test_noise_free_measurements_give_the_arms_base_parameters(model, clean, unseen, method):
    parameters = estimate(method, model, clean, prior=1e12).parameters
    torch.testing.assert_close(parameters, model.body.base.values, rtol=0, atol=1e-8)
    assert score(model, parameters, unseen).nmse.max() < 1e-14


def test_compiled_sums_are_those_of_the_regressor(model, noisy):
    plain = Fixed(model.body.base_regressor(*noisy.states))
    with at_once(333):
        expected, sums = (
            gather(*x).sums for x in ((plain, plain.measurements(noisy.torque)), (model, noisy))
        )
    for one, other in zip(sums, expected):
        torch.testing.assert_close(one, other, rtol=1e-10, atol=1e-9 * float(other.abs().max()))


def test_noise_on_torque_is_averaged_out_and_large_joints_drown_the_wrist(model, noisy, unseen):
    plain, weighted = (
        score(model, estimate(method, model, noisy).parameters, unseen).nmse for method in ("ols", "weighted")
    )
    assert weighted.max() < 1e-3
    assert weighted.mean() <= plain.mean() * 1.5
    if model.joints == 7:
        assert plain.argmax() == 6 and weighted.mean() < 1e-2 * plain.mean()


def test_a_crawl_identifies_worse_than_lively_motion(model, unseen):
    def result(scale):
        noise = replace(NOISE, kind="additive")
        data = measure(model.body, motions(model, 10, seed=1, scale=scale), noise, 0)
        error = score(model, estimate("ols", model, data).parameters, unseen).nmse_mean
        return error, norm(model, data)

    lively, crawl = result(0.5), result(0.02)
    assert lively[0] < crawl[0] and lively[1] < crawl[1]


def test_trajectories_in_sequence_are_one_long_motion(model):
    motion = motions(model, 6, seed=3)
    apart, joined = measure(model.body, motion), measure(model.body, concatenate(motion))
    assert len(joined) == len(apart) - 5  # the shared sample at rest is counted once
    assert norm(model, joined) == pytest.approx(norm(model, apart), rel=0.02)


def test_a_replica_of_the_data_halves_the_covariance(model, clean):
    once, twice = (norm(model, [clean] * n, prior=1e15) for n in (1, 2))
    assert twice == pytest.approx(once / 2, rel=1e-6)


def test_an_arm_at_rest_is_predicted_where_it_rests(model):
    data = measure(model.body, motions(model, 1, seed=1, scale=0.0))
    result = estimate("ols", model, data)
    assert result.parameters.isfinite().all() and result.covariance.isfinite().all()
    predicted = model.torque(result.parameters, *data.states)
    torch.testing.assert_close(predicted, data.torque, rtol=0, atol=1e-5)
