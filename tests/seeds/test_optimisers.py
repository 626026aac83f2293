from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
import torch

from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.compiled import VARIABLE
from sidegan.motion.trajectory import Trajectory
from sidegan.seeds import Gradient, result
from sidegan.seeds.paper import ConditionProblem, Paper
from sidegan.seeds.result import settle
from sidegan.validity import Box, Constraints, check

METHODS = {
    "gradient": Gradient(30, attempts=5, reserve=0.2),
    "paper": Paper(generations=6, ants=20, evaluations=150, attempts=5),
}


@pytest.mark.parametrize("name", METHODS)
def test_seeds_are_valid_and_better_than_random_ones(planar_problem, random, name):
    batch = METHODS[name].optimise(planar_problem, 3, np.random.SeedSequence(1))
    assert len(batch) == 3
    assert check(planar_problem.constraints, planar_problem.trajectory, batch.coefficients).valid.all()
    start = planar_problem.fitness(planar_problem.start(20, random))
    assert batch.fitness.median() < start.median()
    assert batch.attempts >= 3
    assert batch.cpu_seconds > 0


@pytest.mark.parametrize("name", METHODS)
def test_the_same_random_numbers_give_the_same_seeds(planar_problem, name):
    one, two, other = (
        METHODS[name].optimise(planar_problem, 1, np.random.SeedSequence(k)) for k in (5, 5, 6)
    )
    assert len(one) == len(other) == 1
    assert torch.equal(one.coefficients, two.coefficients)
    assert not torch.equal(one.coefficients, other.coefficients)


def test_lwr_seeds_are_valid_and_well_conditioned(lwr_problem):
    batch = Gradient(60, attempts=5, reserve=0.2).optimise(lwr_problem, 6, np.random.SeedSequence(0))
    assert check(lwr_problem.constraints, lwr_problem.trajectory, batch.coefficients).valid.all()
    assert float(batch.fitness.median()) < 400  # random starts: 10⁵ and more


def test_the_diagonal_fitness_is_optimised_when_asked(planar_problem):
    problem = replace(planar_problem, diagonal=True)
    batch = Gradient(40, attempts=5, reserve=0.2).optimise(problem, 4, np.random.SeedSequence(2))
    start = problem.fitness(problem.start(20, torch.Generator().manual_seed(0)))
    assert batch.fitness.median() < start.median()


def test_an_infeasible_home_is_refused(planar):
    around = Box((-0.5, -0.5, 0.2), (0.5, 0.5, 3.0))
    problem = Problem(Constraints(planar, [around]), Trajectory(planar.joints, 3, 8.0), 24)
    with pytest.raises(InfeasibleError, match="home position"):
        Gradient(5, attempts=5, reserve=0.2).optimise(problem, 2, np.random.SeedSequence(0))


def test_a_fitness_nobody_reaches_ends_after_two_barren_rounds(planar_problem, monkeypatch):
    monkeypatch.setattr(result, "HOPELESS", 1.0)
    batch = Gradient(5, attempts=5, reserve=0.2).optimise(planar_problem, 3, np.random.SeedSequence(0))
    assert len(batch) == 0
    assert batch.failed == batch.attempts == 6
    assert "only 0 of 3 seeds" in str(batch.shortfall(3))
    assert "the condition number" in str(batch.shortfall(3))


def test_settling_shrinks_what_leaks_and_gives_up_on_what_does_not_move(planar_problem, random):
    c = planar_problem.start(4, random, 1.05)
    still = torch.zeros_like(c[:1])
    batch = settle(planar_problem, torch.cat([c, still]))
    assert check(planar_problem.constraints, planar_problem.trajectory, batch.coefficients).valid.all()
    assert batch.failed >= 1
    assert batch.faults.get("the condition number") == 1


def test_candidates_that_are_not_numbers_fail(planar_problem, random):
    c = planar_problem.start(2, random)
    c[0] = torch.nan
    assert settle(planar_problem, c).failed == 1


def test_pygmo_sees_the_same_fitness_one_by_one_and_in_a_batch(planar_problem, random):
    udp = ConditionProblem(planar_problem)
    x = torch.rand(5, udp.range.size, generator=random, dtype=torch.float64).numpy() * 2 - 1
    batch = udp.batch_fitness(x.flatten()).reshape(5, -1)
    assert batch.shape == (5, 1 + udp.get_nic())
    for row, vector in zip(batch, x):
        np.testing.assert_allclose(udp.fitness(vector), row)
    c = udp.coefficients(x.flatten())
    np.testing.assert_allclose(np.exp(batch[:, 0]), planar_problem.fitness(c))


def test_pygmo_constraints_have_the_sign_of_the_margins(planar_problem):
    udp = ConditionProblem(planar_problem)
    home = np.zeros(udp.range.size)
    assert (udp.fitness(home)[1:] < 0).all()
    random = np.random.default_rng(0)
    x = random.uniform(-1, 1, (30, home.size))
    violations = udp.batch_fitness(x.flatten()).reshape(30, -1)[:, 1:]
    states = [part.reshape(-1, 2) for part in planar_problem.motion(udp.coefficients(x.flatten()))[1:]]
    margins = planar_problem.constraints.margins(*states)
    for column, margin in zip(violations.T, margins.values()):
        held = (margin.reshape(30, -1) >= 0).all(1).numpy()
        np.testing.assert_array_equal(column <= 0, held)


def test_pygmo_vectors_never_leave_the_linear_limits(planar_problem):
    udp = ConditionProblem(planar_problem)
    x = np.random.default_rng(1).uniform(-1, 1, (50, udp.range.size))
    assert float(planar_problem.limit_use(udp.coefficients(x.flatten())).max()) <= 0.995 + 1e-12


@pytest.mark.parametrize("diagonal", [False, True], ids=["eigenvalue", "diagonal"])
def test_a_small_search_on_the_lwr_ends_valid_under_the_papers_constraints(lwr_problem, diagonal):
    constraints = Constraints(lwr_problem.constraints.arm, lwr_problem.constraints.regions, torque=False)
    problem = replace(lwr_problem, constraints=constraints, samples=60, diagonal=diagonal)
    method = Paper(generations=20, ants=50, evaluations=1000, attempts=3)
    batch = method.optimise(problem, 2, np.random.SeedSequence(0))
    assert len(batch) == 2
    assert check(constraints, problem.trajectory, batch.coefficients).valid.all()
    start = problem.fitness(problem.start(20, torch.Generator().manual_seed(0)))
    assert batch.fitness.max() < 0.3 * start.median()


def test_the_colony_and_the_search_give_one_seed_with_and_without_kernels(planar_problem, monkeypatch):
    seed, method = np.random.SeedSequence(3), Paper(generations=4, ants=12, evaluations=30, attempts=2)
    fitness = []
    for engine in ("numba", "torch") if find_spec("numba") else ("torch",):
        monkeypatch.setenv(VARIABLE, engine)
        fitness.append(method.optimise(planar_problem, 1, seed).fitness)
    torch.testing.assert_close(fitness[0], fitness[-1], rtol=1e-4, atol=0)


@pytest.mark.parametrize(("joints", "samples", "message"), [(3, 24, "joints"), (2, 6, "harmonics")])
def test_a_problem_that_does_not_fit_is_refused(planar_problem, joints, samples, message):
    with pytest.raises(ShapeError, match=message):
        Problem(planar_problem.constraints, Trajectory(joints, 3, 8.0), samples)


def test_a_long_trajectory_is_not_a_straw_man(planar):
    """With the short ones' bandwidth one long trajectory gets as well conditioned as a short one."""
    constraints = Constraints(planar, [])
    short = Problem(constraints, Trajectory(2, 3, 8.0), 24)
    long = Problem(constraints, Trajectory(2, 36, 96.0), 288)
    shorts = Gradient(40, attempts=5, reserve=0.2).optimise(short, 6, np.random.SeedSequence(0))
    one = Gradient(60, attempts=5, reserve=0.2).optimise(long, 1, np.random.SeedSequence(0))
    assert float(one.fitness) < 3 * float(shorts.fitness.median())


def test_a_larger_reserve_leaves_more_room_and_conditions_worse(lwr_problem):
    trajectory = lwr_problem.trajectory
    margins, fitness = [], []
    for reserve in (0.05, 0.3):
        batch = Gradient(60, attempts=5, reserve=reserve).optimise(lwr_problem, 6, np.random.SeedSequence(0))
        found = check(lwr_problem.constraints, trajectory, batch.coefficients).margins
        margins.append(float(found["velocity"].median()))
        fitness.append(float(batch.fitness.median()))
    assert margins[1] > margins[0] + 0.2
    assert fitness[1] > fitness[0]
