"""Design for what recordings left uncertain: against trust's information, and what is identified after."""

import numpy as np
import pytest
import torch

from sidegan.design.problem import Problem
from sidegan.design.sequence import Search, designed, told, value_and_gradient
from sidegan.errors import ShapeError
from sidegan.identification import Measurements, estimate
from sidegan.identification.trust import certainty, grams_of
from sidegan.identification.uncertain import Uncertain, information_on
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check
from tests.identification.recordings import model_of, multisine, truth_of

NOISE, RATE = 0.3, 100.0
SEARCH = Search(starts=4, rough=15, strict=25, samples=8, reserve=0.02)


@pytest.fixture(scope="module")
def poor(planar):
    """A model and its estimate from a recording in which the elbow hardly moves."""
    model = model_of(planar)
    states = [x * torch.tensor([1.0, 1e-2]) for x in multisine(2, 1000)]
    noise = torch.from_numpy(np.random.default_rng(0).normal(size=states[0].shape))
    data = Measurements(*states, model.torque(truth_of(model), *states) + NOISE * noise)
    return model, estimate("weighted", model, data), data


@pytest.fixture(scope="module")
def problem(planar):
    return Problem(Constraints(planar), Trajectory(2, harmonics=3, period=8.0))


def aim_of(poor):
    model, found, _ = poor
    return Uncertain(model, found.covariance, certainty(found), RATE)


@pytest.fixture(scope="module")
def trajectories(problem):
    return problem.start(5, torch.Generator().manual_seed(0), reach=0.5)


def test_what_trajectories_tell_is_what_trust_says(poor, problem, trajectories):
    model, found, _ = poor
    new = told(problem, aim_of(poor), trajectories, 80).information
    scale = found.deviation
    expected = grams_of(model, found, problem.trajectory, trajectories, 80) * RATE * 8.0
    torch.testing.assert_close(new, expected * scale * scale[:, None], rtol=1e-6, atol=1e-9)


def test_the_gradient_is_that_of_the_value(poor, problem, trajectories):
    aim, step = aim_of(poor), 1e-6
    _, gradient = value_and_gradient(problem, aim, trajectories[:2], 60)
    direction = torch.randn(gradient.shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    ends = [value_and_gradient(problem, aim, trajectories[:2] + s * direction, 60)[0] for s in (-step, step)]
    slope = (ends[1] - ends[0]) / (2 * step)
    torch.testing.assert_close((gradient * direction).sum((1, 2, 3)), slope, rtol=1e-4, atol=1e-8)


def test_designed_ones_keep_the_limits_and_tell_more_than_random_ones(poor, problem):
    aim = aim_of(poor)
    _, c = designed([problem], aim, 2, SEARCH, torch.Generator().manual_seed(0))
    assert check(problem.constraints, problem.trajectory, c).valid.all()
    drawn = problem.start(200, torch.Generator().manual_seed(2), reach=0.8)
    drawn = drawn[check(problem.constraints, problem.trajectory, drawn).valid]
    assert len(drawn) > 20
    first = told(problem, aim_of(poor), torch.cat([c[:1], drawn]), 80)
    values = aim_of(poor).value(first)
    assert values[0] < values[1:].min()
    assert 0 < aim.left < 0.6 and aim_of(poor).left == 1
    assert (aim.deviations < aim.before).all()


def test_what_is_identified_after_is_as_certain_as_promised(poor, problem):
    model, before, data = poor
    aim = aim_of(poor)
    _, c = designed([problem], aim, 1, SEARCH, torch.Generator().manual_seed(0))
    states = [x[0] for x in problem.trajectory.roll_out(c, problem.trajectory.times(RATE))[1:]]
    noise = torch.from_numpy(np.random.default_rng(9).normal(size=states[0].shape))
    new = Measurements(*states, model.torque(truth_of(model), *states) + NOISE * noise)
    after = estimate("weighted", model, [data, new])
    change = torch.logdet(after.covariance) - torch.logdet(before.covariance)
    torch.testing.assert_close(aim.before, before.deviation, rtol=1e-6, atol=0)
    torch.testing.assert_close(aim.deviations, after.deviation, rtol=0.3, atol=0)
    assert float((change / (2 * model.count)).exp()) == pytest.approx(aim.left, rel=0.15)


def test_information_is_the_inverse_of_the_covariance_in_whatever_units():
    random = torch.Generator().manual_seed(0)
    root = torch.randn(6, 6, generator=random, dtype=torch.float64)
    unit = 10.0 ** torch.linspace(-3, 1, 6, dtype=torch.float64)
    units, covariance = torch.outer(unit, unit), root @ root.T + torch.eye(6, dtype=torch.float64)
    found = information_on(units * covariance) * units
    torch.testing.assert_close(found, torch.linalg.inv(covariance), rtol=1e-6, atol=1e-6)


def test_what_is_certain_is_known_much_better_than_what_is_not():
    known = information_on(torch.diag(torch.tensor([4.0, 0.0, 1.0], dtype=torch.float64)))
    torch.testing.assert_close(known.diagonal()[[0, 2]], torch.tensor([0.25, 1.0], dtype=torch.float64))
    assert known[1, 1] > 1e6 and (known - torch.diag(known.diagonal())).abs().max() < 1e-6


def test_what_does_not_fit_is_refused(poor):
    model, found, _ = poor
    with pytest.raises(ShapeError, match="are not of a model with"):
        Uncertain(model, found.covariance[:3, :3], certainty(found), RATE)
