"""Seeds by the compiled loop: valid, as good as the batch's, the same whatever the number of threads."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.designer import Compiled
from sidegan.seeds import Gradient
from sidegan.validity import Constraints, check
from tests.validity.critical import limited

from .conftest import BOX, DESK

SEED = np.random.SeedSequence(3)


@pytest.fixture(scope="module")
def problem(problem_of):
    return problem_of("desk")


@pytest.fixture(scope="module")
def found(problem):
    return Compiled(60, 5, reserve=0.05, threads=2).optimise(problem, 6, SEED)


@pytest.mark.parametrize("names", [[], ["acceleration"], ["jerk"], ["acceleration", "jerk"]])
@pytest.mark.parametrize("regions", [[DESK], [DESK, BOX]], ids=["desk", "box"])
def test_they_are_proven_and_as_good_as_those_of_a_batch(arm, problem, names, regions):
    problem = replace(problem, constraints=Constraints(limited(arm, names, 0.1), regions))
    batch = Compiled(60, 5, reserve=0.05, threads=2).optimise(problem, 6, SEED)
    assert len(batch) == 6 and batch.attempts == 6 + batch.failed
    assert check(problem.constraints, problem.trajectory, batch.coefficients).valid.all()
    if regions == [DESK]:
        other = Gradient(60, 5, reserve=0.05).optimise(replace(problem, samples=60), 6, SEED)
        assert batch.fitness.median() < 1.3 * other.fitness.median()


@pytest.mark.parametrize("threads", [1, 3])
def test_threads_change_nothing(problem, found, threads):
    again = Compiled(60, 5, reserve=0.05, threads=threads).optimise(problem, 6, SEED)
    other = Compiled(60, 5, reserve=0.05, threads=threads).optimise(problem, 6, np.random.SeedSequence(4))
    assert torch.equal(again.coefficients, found.coefficients)
    assert not torch.equal(other.coefficients, found.coefficients)


def test_what_is_reserved_is_kept_free(problem):
    batch = Compiled(60, 5, reserve=0.3, threads=1).optimise(problem, 4, SEED)
    margins = check(problem.constraints, problem.trajectory, batch.coefficients).margins
    speed = margins["velocity"] / problem.constraints.arm.velocity_limit.min()
    assert (speed > 0.2).all() and (margins["keep_out"] > 0.1).all()


def test_the_diagonal_fitness_is_optimised_when_asked(problem, found):
    diagonal = replace(problem, diagonal=True)
    batch = Compiled(60, 5, reserve=0.05, threads=2).optimise(diagonal, 4, SEED)
    ratio, others = (diagonal.fitness(x.coefficients).median() for x in (batch, found))
    assert ratio < 0.8 * others
