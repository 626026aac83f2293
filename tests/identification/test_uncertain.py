"""Design for what recordings left uncertain: against trust's information, and what is identified after."""

import pytest
import torch

from sidegan.design.problem import Problem
from sidegan.design.sequence import Search, designed, information
from sidegan.identification import estimate
from sidegan.identification.trust import certainty, grams_of
from sidegan.identification.uncertain import Uncertain
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check
from tests.identification.recordings import half_still, measured

NOISE, RATE = 0.3, 100.0
SEARCH = Search(starts=4, rough=15, strict=25, samples=8, reserve=0.02)


@pytest.fixture(scope="module")
def poor(planar):
    return half_still(planar, NOISE)


@pytest.fixture(scope="module")
def problem(planar):
    return Problem(Constraints(planar), Trajectory(2, harmonics=3, period=8.0))


def aim_of(poor):
    model, found, _ = poor
    return Uncertain(model, found.covariance, certainty(found), RATE)


def test_what_trajectories_tell_is_what_trust_says(poor, problem):
    model, found, _ = poor
    trajectories = problem.start(5, torch.Generator().manual_seed(0), reach=0.5)
    new = information(problem, aim_of(poor), trajectories, 80)
    scale = found.deviation
    expected = grams_of(model, found, problem.trajectory, trajectories, 80) * RATE * 8.0
    torch.testing.assert_close(new, expected * scale * scale[:, None], rtol=1e-6, atol=1e-9)


@pytest.fixture(scope="module")
def made(poor, problem):
    """A designed trajectory, and its aim then."""
    aim = aim_of(poor)
    return designed(problem, aim, 1, SEARCH, torch.Generator().manual_seed(0)), aim


def test_a_designed_one_keeps_the_limits_and_tells_more_than_random_ones(poor, problem, made):
    c, aim = made
    assert check(problem.constraints, problem.trajectory, c).valid.all()
    drawn = problem.start(200, torch.Generator().manual_seed(2), reach=0.8)
    drawn = drawn[check(problem.constraints, problem.trajectory, drawn).valid]
    assert len(drawn) > 20
    values = aim_of(poor).value(information(problem, aim_of(poor), torch.cat([c, drawn]), 80))
    assert values[0] < values[1:].min()
    assert 0 < aim.left < 0.6 and aim_of(poor).left == 1
    assert (aim.deviations < aim.before).all()


def test_what_is_identified_after_is_as_certain_as_promised(poor, problem, made):
    (model, before, data), (c, aim) = poor, made
    states = [x[0] for x in problem.trajectory.roll_out(c, problem.trajectory.times(RATE))[1:]]
    after = estimate("weighted", model, [data, measured(model, states, NOISE, 9)])
    change = torch.logdet(after.covariance) - torch.logdet(before.covariance)
    torch.testing.assert_close(aim.before, before.deviation, rtol=1e-6, atol=0)
    torch.testing.assert_close(aim.deviations, after.deviation, rtol=0.3, atol=0)
    assert float((change / (2 * model.count)).exp()) == pytest.approx(aim.left, rel=0.15)


def known(model, covariance):
    aim = Uncertain(model, covariance, torch.ones(model.joints).double(), RATE)
    return torch.from_numpy(aim.asked(RATE).prior)


def test_what_is_known_is_the_inverse_of_the_covariance_in_whatever_units(poor):
    model, random = poor[0], torch.Generator().manual_seed(0)
    root = torch.randn(model.count, model.count, generator=random, dtype=torch.float64)
    unit = 10.0 ** torch.linspace(-3, 1, model.count, dtype=torch.float64)
    units, covariance = torch.outer(unit, unit), root @ root.T + torch.eye(model.count).double()
    found = known(model, units * covariance) * units
    torch.testing.assert_close(found, torch.linalg.inv(covariance), rtol=1e-6, atol=1e-6)


def test_what_is_certain_is_known_much_better_than_what_is_not(poor):
    variance = torch.ones(poor[0].count, dtype=torch.float64)
    variance[:2] = torch.tensor([4.0, 0.0])
    found = known(poor[0], torch.diag(variance))
    torch.testing.assert_close(found.diagonal()[[0, 2]], torch.tensor([0.25, 1.0], dtype=torch.float64))
    assert found[1, 1] > 1e6 and (found - torch.diag(found.diagonal())).abs().max() < 1e-6
