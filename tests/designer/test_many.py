"""Seeds by the compiled loop: valid, as good as the batch's, the same whatever the number of threads."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.design.problem import Problem
from sidegan.designer import Compiled
from sidegan.motion.compiled import VARIABLE
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from sidegan.seeds import Gradient
from sidegan.validity import Box, Constraints, check
from tests.tiny import tiny
from tests.validity.critical import DESK, limited

pytest.importorskip("numba")

SEED = np.random.SeedSequence(3)


@pytest.fixture(scope="module")
def problem(workspace):
    return Problem(*workspace, samples=40)


@pytest.fixture(scope="module")
def found(problem):
    return Compiled(60, 5, reserve=0.05, threads=2).optimise(problem, 8, SEED)


def test_they_are_proven_and_as_good_as_those_of_a_batch(problem, found):
    assert len(found) == 8 and found.attempts == 8 + found.failed
    assert check(problem.constraints, problem.trajectory, found.coefficients).valid.all()
    batch = Gradient(60, 5, reserve=0.05).optimise(replace(problem, samples=60), 8, SEED)
    assert found.fitness.median() < 1.3 * batch.fitness.median()


@pytest.mark.parametrize("threads", [1, 3])
def test_threads_change_nothing(problem, found, threads):
    again = Compiled(60, 5, reserve=0.05, threads=threads).optimise(problem, 8, SEED)
    assert torch.equal(again.coefficients, found.coefficients)
    other = Compiled(60, 5, 0.05, threads).optimise(problem, 8, np.random.SeedSequence(4))
    assert not torch.equal(other.coefficients, found.coefficients)


def test_what_is_reserved_is_kept_free(problem):
    batch = Compiled(60, 5, reserve=0.3, threads=1).optimise(problem, 4, SEED)
    margins = check(problem.constraints, problem.trajectory, batch.coefficients).margins
    speed = margins["velocity"] / problem.constraints.arm.velocity_limit.min()
    assert (speed > 0.2).all() and (margins["keep_out"] > 0.1).all()


def test_regions_of_the_workspace_are_kept_out_of(arm, problem):
    box = Box((0.4, 0.2, 0.3), (0.6, 0.5, 0.7))
    among = replace(problem, constraints=Constraints(arm, [*problem.constraints.regions, box]))
    batch = Compiled(40, 5, reserve=0.05, threads=2).optimise(among, 4, SEED)
    assert len(batch) == 4
    assert check(among.constraints, among.trajectory, batch.coefficients).valid.all()


def test_the_diagonal_fitness_is_optimised_when_asked(problem, found):
    diagonal = replace(problem, diagonal=True)
    batch = Compiled(60, 5, reserve=0.05, threads=2).optimise(diagonal, 4, SEED)
    ratio, others = (diagonal.fitness(x.coefficients).median() for x in (batch, found))
    assert ratio < 0.8 * others


@pytest.mark.parametrize("names", [["acceleration"], ["jerk"], ["acceleration", "jerk"]])
def test_limits_of_accelerations_and_jerks_are_designed_for(arm, names):
    tight = limited(arm, names, 0.1)
    problem = Problem(Constraints(tight, [DESK]), Trajectory(7), samples=40)
    batch = Compiled(60, 5, reserve=0.05, threads=2).optimise(problem, 6, SEED)
    assert len(batch) == 6
    assert check(problem.constraints, problem.trajectory, batch.coefficients).valid.all()
    other = Gradient(60, 5, reserve=0.05).optimise(replace(problem, samples=60), 6, SEED)
    assert batch.fitness.median() < 1.3 * other.fitness.median()


def test_it_serves_where_there_are_kernels(monkeypatch):
    assert Compiled.serves()
    monkeypatch.setenv(VARIABLE, "torch")
    assert not Compiled.serves()


def test_the_stage_falls_back_to_the_batch(tmp_path, monkeypatch):
    store, config = Store(tmp_path), tiny(experiment="excite")
    assert seed_set(Task(config, store)).maker == "compiled_seeds"
    monkeypatch.setenv(VARIABLE, "torch")
    assert seed_set(Task(config, store)).maker == "seeds"
    assert config.seeds.count == 4 * config.selection.count
