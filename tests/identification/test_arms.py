"""Simulated measurements of the built-in arms, identified and tested on motions that were not seen."""

import pytest
import torch

from sidegan.identification import RIGID, TorqueModel, estimate, measure, score
from sidegan.identification.gather import gather
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from tests.identification.recordings import NOISE, Fixed, at_once


@pytest.fixture(scope="module", params=["planar2", "kuka_lwr4"])
def model(request):
    return TorqueModel(RigidBody(load_robot(request.param)), RIGID)


def motions(model, count, seed):
    """Random trajectories of 8 s at 50 Hz."""
    trajectory = Trajectory(model.joints, period=8.0)
    random = torch.Generator().manual_seed(seed)
    c = 0.5 * torch.randn(count, *trajectory.shape, generator=random, dtype=torch.float64)
    return trajectory.roll_out(c, trajectory.times(50.0))


@pytest.fixture(scope="module")
def noisy(model):
    return measure(model.body, motions(model, 10, seed=1), NOISE, 0)


@pytest.fixture(scope="module")
def unseen(model):
    return measure(model.body, motions(model, 5, seed=2))


@pytest.mark.parametrize("method", ["ols", "weighted"])
def test_noise_free_measurements_give_the_arms_base_parameters(model, unseen, method):
    clean = measure(model.body, motions(model, 10, seed=1))
    parameters = estimate(method, model, clean, prior=1e12).parameters
    torch.testing.assert_close(parameters, model.body.base.values, rtol=0, atol=1e-8)
    assert score(model, parameters, unseen).nmse.max() < 1e-14


def test_compiled_sums_are_those_of_the_regressor(model, noisy):
    plain = Fixed(model.body.base_regressor(*noisy.states))
    with at_once(333):
        expected, sums = gather(plain, plain.measurements(noisy.torque)).sums, gather(model, noisy).sums
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
