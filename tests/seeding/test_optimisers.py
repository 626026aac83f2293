from dataclasses import replace

import numpy as np
import pytest

from sidegan.design.problem import Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.seeding.methods import ConditionProblem, Gradient, Paper
from sidegan.seeding.optimise import settle
from sidegan.validity import Constraints, check
from tests.seeding.conftest import METHODS


def compared(problem, method, count, seed):
    """Valid seeds, and the median fitness of random starts."""
    batch = method.optimise(problem, count, np.random.SeedSequence(seed))
    assert len(batch) == count and batch.attempts >= count and batch.cpu_seconds > 0
    assert check(problem.constraints, problem.trajectory, batch.coefficients).valid.all()
    start = problem.fitness(problem.start(20, np.random.default_rng(0)))
    return batch, float(np.median(start))


@pytest.mark.parametrize("name", METHODS)
def test_seeds_are_valid_better_than_random_and_differ(planar_problem, name):
    (first, start), (other, _) = (compared(planar_problem, METHODS[name], 2, k) for k in (1, 6))
    assert np.median(first.fitness) < start
    assert not np.array_equal(first.coefficients, other.coefficients)


def test_settling_shrinks_invalid_seeds_and_drops_hopeless_ones(planar_problem, random):
    c = planar_problem.start(5, random, 1.05)
    c[3], c[4] = 0, np.nan
    batch = settle(planar_problem, c, 0.5)
    assert check(planar_problem.constraints, planar_problem.trajectory, batch.coefficients).valid.all()
    assert batch.failed >= 2
    assert batch.faults.get("the condition number") == 2


def test_pygmo_gets_the_same_fitness_and_margins_singly_and_batched(planar_problem):
    udp, x = ConditionProblem(planar_problem, 0.5), np.random.default_rng(0).uniform(-1, 1, (30, 12))
    batch, c = udp.batch_fitness(x.ravel()).reshape(30, -1), udp.coefficients(x.ravel())
    assert batch.shape == (30, 1 + udp.get_nic())
    assert np.array_equal(np.moveaxis(c, -1, 1).reshape(30, -1), 0.5 * x)  # all a, then all b
    np.testing.assert_allclose(batch, [udp.fitness(vector) for vector in x])
    np.testing.assert_allclose(np.exp(batch[:, 0]), planar_problem.fitness(c))
    assert (udp.fitness(np.zeros(12))[1:] < 0).all()  # at home


def test_the_papers_optimiser_finds_valid_lwr_seeds(lwr_problem):
    constraints = Constraints(lwr_problem.constraints.arm, lwr_problem.constraints.regions, torque=False)
    problem = replace(lwr_problem, constraints=constraints, samples=60)
    problem = replace(problem, trajectory=Trajectory(7, 6, 2 * np.pi / 0.4), strongest=35)
    batch, _ = compared(problem, Paper(5, ants=50, evaluations=20_000, box=0.2, attempts=10), 1, 0)
    drawn = np.random.default_rng(0).uniform(-0.2, 0.2, (300, *problem.trajectory.shape))
    assert batch.fitness.max() < np.median(problem.fitness(drawn))  # of which hardly one is valid
    assert (np.abs(batch.coefficients[..., 0]) > 0.1999).mean() > 0.4  # on the box


def test_a_long_trajectory_is_as_well_conditioned_as_short_ones(planar):
    """With the short ones' bandwidth one long trajectory gets as well conditioned as a short one."""
    constraints = Constraints(planar, [])
    short = Problem(constraints, Trajectory(2, 3, 8.0), 24)
    long = Problem(constraints, Trajectory(2, 36, 96.0), 288)
    shorts = Gradient(40, attempts=5, reserve=0.2).optimise(short, 6, np.random.SeedSequence(0))
    single = Gradient(60, attempts=5, reserve=0.2).optimise(long, 1, np.random.SeedSequence(0))
    assert single.fitness[0] < 3 * np.median(shorts.fitness)


def test_lwr_seeds_are_well_conditioned_and_a_larger_reserve_leaves_more_room(lwr_problem):
    margins, fitness = [], []
    for reserve in (0.05, 0.2, 0.3):
        batch, _ = compared(lwr_problem, Gradient(60, attempts=5, reserve=reserve), 6, 0)
        found = check(lwr_problem.constraints, lwr_problem.trajectory, batch.coefficients).margins
        margins.append(np.median(found["velocity"]))
        fitness.append(np.median(batch.fitness))
    assert fitness[1] < 400  # random starts: 10⁵ and more
    assert margins[2] > margins[0] + 0.2 and fitness[2] > fitness[0]
