"""Expected errors of sets: least squares of identification, which finds them from samples, as the oracle."""

from dataclasses import replace

import pytest
import torch

from sidegan.design.prediction import (
    SAMPLES,
    Prediction,
    TorqueNoise,
    error_slope,
    inverse_of,
    random_motions,
    wanted_torques,
)
from sidegan.errors import ShapeError
from sidegan.identification import study
from sidegan.identification.measurements import Noise
from sidegan.motion.dynamics import RigidBody
from tests.identification.recordings import study_settings

PAPER = Noise()


def predicting(problem, tests, noise, rate=20.0):
    body, family = problem.body, problem.trajectory
    times = family.times(rate)
    return Prediction(body, family, wanted_torques(body, family, tests, times), noise, times)


@pytest.fixture(params=["planar_problem", "lwr_problem"])
def problem(request):
    return request.getfixturevalue(request.param)


def equal(problem, level=0.1):
    return TorqueNoise.proportional(level, torch.ones(problem.body.joints, dtype=torch.float64))


def test_errors_under_the_papers_noise_are_those_of_identification(problem):
    c, tests = random_motions(problem, 9, seed=1), random_motions(problem, 3, 0.8, seed=2)
    settings = study_settings(noise=PAPER, rate=20.0)
    family = problem.trajectory
    expected = study.expected_errors(problem.body, (family, c), (family, tests), settings)
    expected = torch.tensor(expected[~expected.weighted].nmse.to_numpy())
    predicting_ours = predicting(problem, tests, equal(problem))
    sums = [x.sum(0, keepdim=True) for x in predicting_ours.informations(c)]
    torch.testing.assert_close(predicting_ours.nmse(*sums)[0], expected, rtol=1e-7, atol=0)


def test_errors_under_constant_noise_fall_with_the_number_of_measurements_and_by_the_share(problem):
    c, tests = random_motions(problem, 12, seed=1), random_motions(problem, 3, 0.8, seed=2)
    one, coarse = (TorqueNoise.constant(problem.body, share) for share in (0.01, 0.02))
    information, noise = predicting(problem, tests, one).informations(c)
    torch.testing.assert_close(information, noise)  # weighted by one over the deviation
    errors = [predicting(problem, tests, x).of_draws(c, 12, 1) for x in (one, coarse)]
    torch.testing.assert_close(errors[1], 4 * errors[0], rtol=1e-4, atol=0)
    twice = predicting(problem, tests, one).of_draws(c.repeat(2, 1, 1, 1), 24, 1)
    torch.testing.assert_close(twice, errors[0] / 2, rtol=1e-4, atol=0)


def test_few_samples_stand_for_many(lwr_problem):
    c, tests = random_motions(lwr_problem, 35, seed=1), random_motions(lwr_problem, 3, 0.8, seed=2)
    for noise in (equal(lwr_problem), TorqueNoise.constant(lwr_problem.body, 0.01)):
        fine = predicting(lwr_problem, tests, noise, 100.0)
        times = lwr_problem.trajectory.grid(SAMPLES)
        coarse = Prediction(fine.body, fine.trajectory, fine.wanted, noise, times, each=1601 / SAMPLES)
        torch.testing.assert_close(coarse.of_draws(c, 35, 1), fine.of_draws(c, 35, 1), rtol=0.02, atol=0)


def test_what_nothing_excites_is_not_known(planar_problem):
    """A set that rests has the error of no estimate at all, with the prior alone; copies of it as well."""
    tests = random_motions(planar_problem, 3, 0.8, seed=2)
    ours = predicting(planar_problem, tests, equal(planar_problem))
    still = torch.zeros(4, *planar_problem.trajectory.shape, dtype=torch.float64)
    values = planar_problem.body.base.values
    rest, nothing = ours.of_draws(still, 4, 1)[0], torch.einsum("p,kpq,q->k", values, ours.wanted, values)
    assert (rest > 0.1 * nothing).all() and rest.isfinite().all()
    moving = random_motions(planar_problem, 4, seed=1)
    assert (ours.of_draws(moving, 4, 1)[0] < 1e-2 * rest).all()


@pytest.mark.parametrize("constant", [False, True])
def test_the_slope_of_the_error_agrees_with_finite_differences(problem, constant):
    """Of half the mean logarithm of the joints' errors and half the logarithm of their mean."""
    c, tests = random_motions(problem, 30, seed=1), random_motions(problem, 5, 0.8, seed=2)
    noise = TorqueNoise.constant(problem.body, 0.01) if constant else equal(problem)
    ours = replace(predicting(problem, tests, noise), least=0.0)
    information, spread = ours.informations(c)
    mean, mean_noise = information.mean(0), spread.mean(0)
    directions, shares = error_slope(ours.wanted, mean, mean_noise)
    size = len(mean)
    torch.testing.assert_close(directions.T @ mean @ directions, torch.eye(size).double(), rtol=0, atol=1e-6)

    def error(step, one):
        nmse = ours.nmse((mean + step * one)[None], mean_noise[None])[0]
        return float(nmse.log().mean() + nmse.mean().log()) / 2

    parts = torch.einsum("pk,bpq,qk->bk", directions, information[:4], directions) @ shares
    for one, part in zip(information, parts):
        slope = (error(1e-5, one) - error(-1e-5, one)) / 2e-5
        assert slope == pytest.approx(-2 * float(part), rel=0.02 if not constant else 1e-4)
    assert float(shares.sum()) == pytest.approx(1, rel=0.02 if not constant else 1e-6)
    assert (shares.diff() <= 0).all()


def test_an_arm_without_limits_has_noise_of_a_share_of_its_largest_torques(arm):
    free = replace(arm, torque_limit=torch.full_like(arm.torque_limit, torch.inf))
    deviation = TorqueNoise.constant(RigidBody(free), 0.01).deviation
    assert (deviation > 0).all() and deviation.min() >= 0.02 * deviation.max() * (1 - 1e-12)
    stated = TorqueNoise.constant(RigidBody(arm), 0.01).deviation
    torch.testing.assert_close(stated, 0.01 * arm.torque_limit)


def test_sets_are_drawn_without_replacement_and_a_small_pool_has_none(planar_problem):
    c = random_motions(planar_problem, 6, seed=1)
    ours = predicting(planar_problem, c[:3], equal(planar_problem))
    whole = ours.of_draws(c, 6, 3)
    torch.testing.assert_close(whole, whole[:1].expand(3, -1))
    with pytest.raises(ShapeError, match="set of 7 trajectories cannot be drawn from 6"):
        ours.of_draws(c, 7)


def test_the_inverse_keeps_its_digits_in_any_units():
    random = torch.Generator().manual_seed(0)
    rows = torch.randn(5, 20, 6, generator=random, dtype=torch.float64)
    units = torch.logspace(-6, 4, 6, dtype=torch.float64)
    rows = rows * units
    inverse = inverse_of(rows.mT @ rows, 0.0)
    expected = torch.linalg.inv((rows / units).mT @ (rows / units)) / units / units[:, None]
    torch.testing.assert_close(inverse, expected, rtol=1e-9, atol=0)
