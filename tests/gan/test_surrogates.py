import dataclasses

import torch

from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints
from tests.gan.conftest import random


def test_position_and_velocity_margins_are_exact(arm):
    family = Trajectory(7, 3, 12.0)
    c = 0.5 * torch.randn(20, *family.shape, generator=random(), dtype=torch.float64)
    predictor = SuccessPredictor(arm, family, len(Constraints(arm).labels), 8, 60)
    found = predictor.margins(c.float())[:, :2].amin(2)
    motion = family.roll_out(c, family.times(100))
    half = (arm.position_upper - arm.position_lower) / 2
    q, dq = motion.position, motion.velocity.abs()
    position = (torch.minimum(q - arm.position_lower, arm.position_upper - q) / half).amin((1, 2))
    velocity = (1 - dq / arm.velocity_limit).amin((1, 2))
    torch.testing.assert_close(found.double(), torch.stack([position, velocity], 1), rtol=0, atol=2e-3)


def test_the_worst_moment_of_each_constraint_decides(planar, family):
    predictor = SuccessPredictor(planar, family, 3, 8, 10)
    good = torch.full((1, 3, 10), 0.9)
    bad = good.clone()
    bad[0, 2, 4] = -0.5
    high, low = predictor.log_probability(torch.cat([good, bad])).exp().tolist()
    assert high > 0.99 and low < 0.01


def test_a_log_probability_is_not_positive(planar, family, wild):
    predictor = SuccessPredictor(planar, family, 4, 8, 10)
    out = predictor(wild.float())
    assert out.shape == (len(wild),)
    assert (out <= 0).all()


def test_an_arm_with_nothing_to_learn_about_has_a_predictor_too(planar, family):
    free = dataclasses.replace(planar, torque_limit=torch.full((2,), torch.inf).double())
    constraints = Constraints(free)
    predictor = SuccessPredictor(free, family, 2, 8, 10)
    assert len(constraints.labels) >= 2
    assert predictor.margins(torch.zeros(3, *family.shape)).shape == (3, 2, 10)
    assert (predictor(torch.zeros(3, *family.shape)) > -0.1).all()


def test_standardised_features_come_back_as_logs(planar, family):
    features = torch.rand(50, 4, generator=random(), dtype=torch.float64) * torch.tensor([1e-4, 1, 10, 1e3])
    converter = Converter(planar, family, 4, 8, 10)
    converter.fit_standard(features)
    standard = converter.standardise(features)
    torch.testing.assert_close(standard.mean(0), torch.zeros(4), rtol=0, atol=1e-4)
    torch.testing.assert_close(standard.std(0), torch.ones(4), rtol=0, atol=1e-4)
    torch.testing.assert_close(converter.log_features(standard), features.log().float(), rtol=1e-4, atol=1e-4)


def test_a_constant_or_vanishing_feature_stays_finite(planar, family):
    features = torch.zeros(10, 2, dtype=torch.float64)
    features[:, 1] = 3.0
    converter = Converter(planar, family, 2, 8, 10)
    converter.fit_standard(features)
    assert torch.isfinite(converter.standardise(features)).all()
    assert converter(torch.randn(5, *family.shape)).shape == (5, 2)
