"""Expected errors of sets: least squares of identification, which finds them from samples, as the oracle."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.base.arrays import flatten
from sidegan.design.objective import Objective
from sidegan.design.prediction import (
    LEAST_TIMES,
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
from tests.refusals import refused

PAPER = Noise()


def predicting(problem, tests, noise, rate=20.0):
    body, family = problem.body, problem.trajectory
    times = family.times(rate)
    return Prediction(body, family, wanted_torques(body, family, tests, times), noise, times)


@pytest.fixture(params=["planar_problem", "lwr_problem"])
def problem(request):
    return request.getfixturevalue(request.param)


def equal(problem, level=0.1):
    return TorqueNoise.proportional(level, np.ones(problem.body.joints))


def test_errors_with_the_papers_noise_are_those_of_identification(problem):
    c, tests = random_motions(problem, 9, seed=1), random_motions(problem, 3, 0.8, seed=2)
    settings = study_settings(noise=PAPER, rate=20.0)
    family = problem.trajectory
    expected = study.expected_errors(problem.body, (family, c), (family, tests), settings)
    expected = expected[~expected.weighted].nmse.to_numpy()
    predicting_ours = predicting(problem, tests, equal(problem))
    sums = [x.sum(0, keepdims=True) for x in predicting_ours.informations(c)]
    np.testing.assert_allclose(predicting_ours.nmse(*sums)[0], expected, rtol=1e-7, atol=0)


def test_errors_with_constant_noise_scale_with_noise_and_measurements(problem):
    c, tests = random_motions(problem, 12, seed=1), random_motions(problem, 3, 0.8, seed=2)
    fine, coarse = (TorqueNoise.constant(problem.body, share) for share in (0.01, 0.02))
    information, noise = predicting(problem, tests, fine).informations(c)
    np.testing.assert_allclose(information, noise)  # weighted by one over the deviation
    errors = [predicting(problem, tests, x).of_draws(c, 12, 1) for x in (fine, coarse)]
    np.testing.assert_allclose(errors[1], 4 * errors[0], rtol=1e-4, atol=0)
    twice = predicting(problem, tests, fine).of_draws(np.tile(c, (2, 1, 1, 1)), 24, 1)
    np.testing.assert_allclose(twice, errors[0] / 2, rtol=1e-4, atol=0)


def test_a_search_minimises_the_error_of_its_trajectory(problem):
    c, tests = random_motions(problem, 4, seed=1), random_motions(problem, 3, 0.8, seed=2)
    noise = TorqueNoise.constant(problem.body, 0.01)
    samples = problem.trajectory.grid(problem.samples)
    ours = replace(predicting(problem, tests, noise), times=samples)
    objective, points = Objective(problem, ours.goal), flatten(c, 2)
    covariance = inverse_of(ours.informations(c)[0], ours.least)
    errors = (ours.wanted.sum(0) * covariance).sum((1, 2))
    found = [objective(x, np.zeros_like(x))[0] for x in points]
    np.testing.assert_allclose(found, np.log(errors), rtol=1e-6)


def test_few_samples_predict_the_error_of_many(lwr_problem):
    c, tests = random_motions(lwr_problem, 35, seed=1), random_motions(lwr_problem, 3, 0.8, seed=2)
    for noise in (equal(lwr_problem), TorqueNoise.constant(lwr_problem.body, 0.01)):
        fine = predicting(lwr_problem, tests, noise, 100.0)
        times = lwr_problem.trajectory.grid(LEAST_TIMES)
        coarse = Prediction(fine.body, fine.trajectory, fine.wanted, noise, times, each=1601 / LEAST_TIMES)
        np.testing.assert_allclose(coarse.of_draws(c, 35, 1), fine.of_draws(c, 35, 1), rtol=0.02, atol=0)


def test_without_excitation_the_error_is_that_of_the_prior(planar_problem):
    """A set that rests has the error of no estimate at all, with the prior alone; copies of it as well."""
    tests = random_motions(planar_problem, 3, 0.8, seed=2)
    ours = predicting(planar_problem, tests, equal(planar_problem))
    still = np.zeros((4, *planar_problem.trajectory.shape))
    values = planar_problem.body.base.values
    rest, nothing = ours.of_draws(still, 4, 1)[0], np.einsum("p,kpq,q->k", values, ours.wanted, values)
    assert (rest > 0.1 * nothing).all() and np.isfinite(rest).all()
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
    np.testing.assert_allclose(directions.T @ mean @ directions, np.eye(size), rtol=0, atol=1e-6)

    def error(step, own):
        nmse = ours.nmse((mean + step * own)[None], mean_noise[None])[0]
        return float(np.log(nmse).mean() + np.log(nmse.mean())) / 2

    parts = np.einsum("pk,bpq,qk->bk", directions, information[:4], directions) @ shares
    for own, part in zip(information, parts):
        slope = (error(1e-5, own) - error(-1e-5, own)) / 2e-5
        assert slope == pytest.approx(-2 * float(part), rel=0.02 if not constant else 1e-4)
    assert float(shares.sum()) == pytest.approx(1, rel=0.02 if not constant else 1e-6)
    assert (np.diff(shares) <= 0).all()


def test_without_torque_limits_noise_scales_with_the_largest_torques(arm):
    free = replace(arm, torque_limit=np.full_like(arm.torque_limit, np.inf))
    deviation = TorqueNoise.constant(RigidBody(free), 0.01).deviation
    assert (deviation > 0).all() and deviation.min() >= 0.02 * deviation.max() * (1 - 1e-12)
    stated = TorqueNoise.constant(RigidBody(arm), 0.01).deviation
    np.testing.assert_allclose(stated, 0.01 * arm.torque_limit)


def test_sets_are_drawn_without_replacement(planar_problem):
    c = random_motions(planar_problem, 6, seed=1)
    ours = predicting(planar_problem, c[:3], equal(planar_problem))
    whole = ours.of_draws(c, 6, 3)
    np.testing.assert_allclose(whole, np.broadcast_to(whole[0], whole.shape))
    with refused(ShapeError, "7", "6"):
        ours.of_draws(c, 7)


def test_the_inverse_keeps_its_digits_in_any_units():
    random = np.random.default_rng(0)
    rows = random.standard_normal((5, 20, 6))
    units = np.logspace(-6, 4, 6)
    rows = rows * units
    inverse = inverse_of(rows.mT @ rows, 0.0)
    expected = np.linalg.inv((rows / units).mT @ (rows / units)) / units / units[:, None]
    np.testing.assert_allclose(inverse, expected, rtol=1e-9, atol=0)
