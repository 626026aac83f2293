"""Optimisation under limits of acceleration and jerk: penalty and slope, evaluation, seeds."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.design.objective import value_and_gradient
from sidegan.design.penalty import Penalty
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER
from sidegan.seeds import Gradient
from sidegan.seeds.paper import Paper
from sidegan.validity import Constraints, check
from tests.validity.critical import limited

from .conftest import assert_slopes, states_of

BOTH = ["acceleration", "jerk"]


def tight(problem, names, share):
    """The same problem of an arm with limits of acceleration and jerk."""
    constraints = problem.constraints
    arm = limited(constraints.arm, names, share)
    return replace(problem, constraints=Constraints(arm, constraints.regions))


def shares(problem, c, name):
    """Largest share of a limit that each trajectory uses, (B,), at 4,000 samples."""
    times = problem.trajectory.grid(4000)
    x = problem.trajectory.derivative(c, times, HIGHER[name]).abs()
    return (x / problem.constraints.higher[name]).amax((1, 2))


@pytest.mark.parametrize("names", [BOTH, ["acceleration"], ["jerk"]])
def test_the_gradient_agrees_with_finite_differences(planar_problem, random, names):
    """Against the same function without limits: the rest of it is tested elsewhere."""
    problem = tight(planar_problem, names, 0.02)

    def extra(x):
        pairs = [value_and_gradient(one, x, Penalty(300.0)) for one in (problem, planar_problem)]
        return [a - b for a, b in zip(*pairs)]

    assert (assert_slopes(extra, problem.start(4, random, 3.0), random, rtol=1e-4, atol=1e-4) > 0.1).all()


def test_what_stays_below_the_reserve_costs_nothing(planar_problem, random):
    problem, penalty = tight(planar_problem, BOTH, 0.1), Penalty(300.0, limits=0.2)
    c = problem.start(8, random, 0.79)
    torch.testing.assert_close(
        value_and_gradient(problem, c, penalty), value_and_gradient(planar_problem, c, penalty)
    )
    values = [value_and_gradient(one, 1.3 * c, penalty)[0] for one in (problem, planar_problem)]
    states, limits = states_of(problem, 1.3 * c), problem.constraints.higher
    beyond = [(states[HIGHER[x]].abs() / limits[x] - 0.8).clamp_min(0) for x in BOTH]
    cost = 300 * (torch.cat(beyond, 2) ** 2).sum(2).mean(1)
    assert (cost > 0).all()
    torch.testing.assert_close(values[0] - values[1], cost)


@pytest.mark.parametrize("method", [Gradient(40, 5, reserve=0.05), Paper(6, 20, 200, box=0.5, attempts=5)])
def test_seeds_keep_the_limits_and_use_them(planar_problem, method):
    problem = tight(planar_problem, BOTH, 0.1)
    batch = method.optimise(problem, 3, np.random.SeedSequence(1))
    assert len(batch) == 3
    found = check(problem.constraints, problem.trajectory, batch.coefficients)
    assert found.valid.all() and {"acceleration", "jerk"} <= set(found.margins)
    most = torch.stack([shares(problem, batch.coefficients, one) for one in BOTH]).amax(0)
    assert (most <= 1).all() and most.max() > 0.8
    free = method.optimise(planar_problem, 3, np.random.SeedSequence(1))
    assert not check(problem.constraints, problem.trajectory, free.coefficients).valid.any()


def test_an_optimum_under_the_limits_is_better_than_one_slowed_down(planar_problem):
    """What the limits are for: the unlimited optimum, made slow enough, tells less."""
    problem, method = tight(planar_problem, ["acceleration"], 0.05), Gradient(80, 5, reserve=0.05)
    ours, theirs = (method.optimise(x, 12, np.random.SeedSequence(4)) for x in (problem, planar_problem))
    stretch = shares(problem, theirs.coefficients, "acceleration").sqrt().clamp_min(1)
    slowed = [
        float(replace(problem, trajectory=Trajectory(2, 3, 8.0 * s)).fitness(c[None] / s))
        for c, s in zip(theirs.coefficients, stretch.tolist())
    ]
    assert (stretch > 1.1).all()
    assert ours.fitness.median() < np.median(slowed)
