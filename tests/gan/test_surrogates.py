"""Success predictor and converter: what they see, and what they compute exactly."""

import dataclasses

import numpy as np
import pytest
import torch

from sidegan.gan.networks import RollOut
from sidegan.gan.pretraining import scaled_margins
from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.gan.tensors import numpy_array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints
from tests.gan.conftest import normal, random
from tests.validity.critical import limited


def test_input_channels_are_the_exact_motion(arm):
    family = Trajectory(7, 5, 10.0, [0.1, -0.2, 0.3, -0.4, 0.5, -0.6, 0.7])
    steps, fine, c = 30, 4, normal(family, count=6)
    network = RollOut(arm, family, steps)
    channels = network(c)
    assert channels.shape == (6, network.channels, steps)
    motion = family.roll_out(numpy_array(c), family.grid(steps * fine))
    middle = (arm.position_lower + arm.position_upper) / 2
    used = (motion.position - middle) / (arm.position_upper - middle)
    rate = motion.velocity / arm.velocity_limit
    q, share, speed, ddq = (x[:, ::fine] for x in (motion.position, used, rate, motion.acceleration))
    peaks = [np.abs(x).reshape(6, steps, -1).max(2, keepdims=True) for x in (used, rate)]
    expected = np.concatenate([np.sin(q), np.cos(q), share, speed, ddq / 5, *peaks], 2)
    np.testing.assert_allclose(channels, expected.mT, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "higher"),
    [
        ("kuka_lwr4", []),
        *(("planar2", x) for x in (["acceleration"], ["jerk"], ["acceleration", "jerk"])),
    ],
)
def test_margins_of_linear_constraints_are_exact(name, higher):
    arm = limited(load_robot(name), higher, 0.1)
    family, constraints = Trajectory(arm.joints, 3, 8.0), Constraints(arm)
    predictor, c = SuccessPredictor(arm, family, len(constraints.labels), 8, 400), normal(family, 5, 0.1, 20)
    found, exact = numpy_array(predictor.margins(c)), scaled_margins(constraints, family, numpy_array(c), 400)
    assert exact.shape == found.shape == (20, len(constraints.labels), 400)
    for k in range(2 + len(higher)):
        predicted, other = (x[:, k].min(1) for x in (found, exact))
        np.testing.assert_allclose(predicted.clip(-1, 1), other, rtol=0, atol=5e-3)


def test_an_arm_with_only_linear_constraints_has_a_predictor_too(planar, family):
    free = dataclasses.replace(planar, torque_limit=np.full(2, np.inf))
    predictor, rest = SuccessPredictor(free, family, 2, 8, 10), torch.zeros(3, *family.shape)
    assert predictor.margins(rest).shape == (3, 2, 10)
    assert (predictor(rest) > -0.1).all()


def test_standardised_features_come_back_as_logs(planar, family):
    features = torch.rand(50, 4, generator=random(), dtype=torch.float64) * torch.tensor([1e-4, 1, 10, 1e3])
    converter = Converter(planar, family, 4, 8, 10)
    converter.fit_standard(features)
    standard = converter.standardise(features)
    torch.testing.assert_close(standard.mean(0), torch.zeros(4), rtol=0, atol=1e-4)
    torch.testing.assert_close(standard.std(0), torch.ones(4), rtol=0, atol=1e-4)
    torch.testing.assert_close(converter.log_features(standard), features.log().float(), rtol=1e-4, atol=1e-4)
    flat = torch.tensor([[0.0, 3.0, 3.0, 0.0]], dtype=torch.float64).expand(10, 4)  # constant or vanishing
    converter.fit_standard(flat)
    assert torch.isfinite(converter.standardise(flat)).all()
