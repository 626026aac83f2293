import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.conditional.problem import ConditionedProblem, information_losses, variances
from sidegan.design.excitation import excitation_of
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.motion.dynamics import gram
from sidegan.validity import Constraints
from tests.conditional.conftest import random

SAMPLES = 24


@pytest.fixture(scope="module")
def c(constraints, family, conditions):
    return Problem(constraints, family, SAMPLES).start(len(conditions), random(), 0.9)


@pytest.fixture(scope="module")
def problem(space, conditions, family):
    quiet = Constraints(space.constraints.arm, space.constraints.regions, torque=False)
    around = space.surroundings
    return ConditionedProblem(quiet, family, SAMPLES, condition=conditions, surroundings=around, torque=True)


def test_motion_is_that_of_a_family_with_its_home_and_period(problem, family, conditions, c):
    found = problem.motion(c)
    for k in range(len(c)):
        own = conditions.row(k).family(family)
        expected = own.roll_out(c[k : k + 1], own.grid(SAMPLES))
        for x, y in zip(found[1:], expected[1:]):
            torch.testing.assert_close(x[k], y[0], atol=1e-10, rtol=1e-10)


def test_information_is_that_of_a_family_with_its_home_and_period(problem, family, conditions, c):
    found = problem.gram(c)
    for k in range(len(c)):
        expected = gram(problem.body, conditions.row(k).family(family), c[k : k + 1], SAMPLES)
        torch.testing.assert_close(found[k], expected[0])


def test_regions_are_as_far_as_the_true_constraints_say(space, conditions, constraints):
    q = torch.rand(len(conditions), 30, 2, generator=random(), dtype=torch.float64) * 5 - 2.5
    near = space.surroundings.clearances(q, conditions)
    least = torch.cat(list(near.values()), 2).amin(2)
    for k in range(len(conditions)):
        asked = Constraints(constraints.arm, conditions.row(k).regions(), torque=False)
        expected = asked.clearances(q[k])["keep_out"].amin(1)
        torch.testing.assert_close(least[k], expected, atol=1e-9, rtol=1e-9)


def test_distances_within_reach_are_the_same(space, conditions):
    q = torch.rand(len(conditions), 30, 2, generator=random(), dtype=torch.float64) * 5 - 2.5
    near, whole = (space.surroundings.clearances(q, conditions, x)["obstacle"] for x in (0.2, torch.inf))
    torch.testing.assert_close(near[whole < 0.2], whole[whole < 0.2])
    assert (near[whole >= 0.2] >= 0.2).all() and (near == torch.inf).any()


def test_what_violates_nothing_costs_nothing_and_the_other_way_round(problem, space, family, conditions, c):
    none = Penalty(1.0, limits=0.0, torque=0.0, distance=0.0)
    cost = problem.violation(0.5 * c, none)
    for k in range(len(c)):
        x = conditions.row(k)
        own = x.family(family)
        motion = own.roll_out(0.5 * c[k : k + 1], own.grid(SAMPLES))
        margins = x.constraints(space.constraints).margins(*(y[0] for y in motion[1:]))
        del margins["velocity"]  # a share of it is kept by construction
        violated = any(bool((m < 0).any()) for m in margins.values())
        assert (float(cost[k]) > 0) == violated


def directional(f, c, step=1e-5):
    """Slope of f along a random direction, by its gradient and by a difference."""
    direction = torch.randn(c.shape, generator=random(7), dtype=torch.float64)
    given = c.clone().requires_grad_(True)
    (gradient,) = torch.autograd.grad(f(given).sum(), given)
    with torch.no_grad():
        difference = (f(c + step * direction) - f(c - step * direction)).sum() / (2 * step)
    return float((gradient * direction).sum()), float(difference)


def test_gradients_of_the_violation_are_exact(problem, c):
    penalty = Penalty(3.0, limits=0.0, torque=0.1, distance=0.2)
    found, expected = directional(lambda x: problem.violation(x, penalty), c)
    assert found == pytest.approx(expected, rel=1e-4) and abs(expected) > 1e-3


@settings(max_examples=15, deadline=None)
@given(st.lists(st.sampled_from([0.0, 0.5, 2.0]), min_size=6, max_size=6))
def test_gradients_of_the_information_losses_are_exact(problem, c, weights):
    each = torch.tensor([weights], dtype=torch.float64).repeat(len(c), 1)
    each[::3] = 0  # no link matters to every third
    found, expected = directional(lambda x: sum(information_losses(problem, x, each)), c)
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_information_losses_are_the_smooth_condition_number_and_the_sum_of_variances(problem, c):
    grams = problem.gram(c)
    weights = torch.rand(len(c), grams.shape[1], generator=random(), dtype=torch.float64)
    ratio, told = information_losses(problem, c, weights)
    exact = excitation_of(problem.body, grams).eigenvalue_fitness.log()
    assert ((ratio >= exact - 1e-6) & (ratio <= exact + 0.4)).all()
    inverse = torch.linalg.inv(grams).diagonal(dim1=1, dim2=2)
    torch.testing.assert_close(variances(problem.body, grams), inverse, rtol=1e-6, atol=0)
    torch.testing.assert_close(told, (weights * inverse).sum(1).log(), rtol=1e-6, atol=1e-6)
    assert (information_losses(problem, c, 0 * weights)[1] == 0).all()
