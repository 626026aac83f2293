"""Simulated measurements of the built-in arms, identified and tested on motions that were not seen."""

import pytest
import torch

from sidegan.identification import RIGID, TorqueModel, estimate, measure, score
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import built_in_robots, load_robot
from tests.identification.recordings import NOISE


@pytest.mark.parametrize("name", built_in_robots())
def test_noise_on_torque_is_averaged_out_and_large_joints_drown_the_wrist(name):
    model = TorqueModel(RigidBody(load_robot(name)), RIGID)
    trajectory, random = Trajectory(model.joints, period=8.0), torch.Generator().manual_seed(1)
    c = 0.5 * torch.randn(15, *trajectory.shape, generator=random, dtype=torch.float64)
    seen, other = (trajectory.roll_out(part, trajectory.times(50.0)) for part in (c[:10], c[10:]))
    clean, unseen = (measure(model.body, motion) for motion in (seen, other))
    noisy = measure(model.body, seen, NOISE, 0)
    nmse = {}
    for method in ("ols", "weighted"):
        parameters = estimate(method, model, clean, prior=1e12).parameters
        torch.testing.assert_close(parameters, model.body.base.values, rtol=0, atol=1e-8)
        assert score(model, parameters, unseen).nmse.max() < 1e-14
        nmse[method] = score(model, estimate(method, model, noisy).parameters, unseen).nmse
    assert nmse["weighted"].max() < 1e-3
    assert nmse["weighted"].mean() <= nmse["ols"].mean() * 1.5
    if model.joints == 7:
        assert nmse["ols"].argmax() == 6 and nmse["weighted"].mean() < 1e-2 * nmse["ols"].mean()
