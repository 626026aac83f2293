import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.errors import ConfigError, InfeasibleError, StorageError
from sidegan.motion.trajectory import Trajectory
from sidegan.seeds import Gradient, Seeds, Tasks, make_long, make_seeds, result
from sidegan.seeds.paper import Paper
from sidegan.validity import check

METHOD = Gradient(10, attempts=5, reserve=0.2)
PAPER = Paper(generations=5, ants=20, evaluations=60, attempts=5)


def made(problem, work, workers=1, method=METHOD, count=5):
    work.mkdir(exist_ok=True)
    return make_seeds(problem, method, Tasks(count, 2, work, workers), np.random.SeedSequence(4))


@pytest.mark.parametrize("method", [METHOD, PAPER], ids=["gradient", "paper"])
def test_results_do_not_depend_on_the_number_of_workers(planar_problem, tmp_path, method):
    one = made(planar_problem, tmp_path / "one", 1, method)
    two = made(planar_problem, tmp_path / "two", 2, method)
    assert len(one) == 5
    assert torch.equal(one.coefficients, two.coefficients)
    assert check(planar_problem.constraints, planar_problem.trajectory, one.coefficients).valid.all()


class Counting:
    """Counts the tasks that it is given."""

    def __init__(self, method=METHOD):
        self.calls, self.method = 0, method

    def optimise(self, problem, count, seed):
        self.calls += 1
        return self.method.optimise(problem, count, seed)


@pytest.mark.parametrize("each", [METHOD, PAPER], ids=["gradient", "paper"])
def test_a_second_start_redoes_only_what_is_missing_or_damaged(planar_problem, tmp_path, each):
    first = made(planar_problem, tmp_path, method=each)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 3
    files[0].unlink()
    files[1].write_bytes(files[1].read_bytes()[:100])
    method = Counting(each)
    again = made(planar_problem, tmp_path, method=method)
    assert method.calls == 2
    assert torch.equal(first.coefficients, again.coefficients)


def test_a_task_that_ends_after_the_set_was_made_leaves_nothing(planar_problem, tmp_path):
    work = tmp_path / "made.work"

    class Late(Counting):
        """Ends when somebody else has made the whole set."""

        def optimise(self, problem, count, seed):
            batch = super().optimise(problem, count, seed)
            shutil.rmtree(work)
            return batch

    with pytest.raises(StorageError, match=r"cannot write .*seeds-00000\.pt"):
        made(planar_problem, work, method=Late())
    assert not work.exists()


def test_starts_that_fail_are_replaced_by_further_tasks(planar_problem, tmp_path):
    class Lazy(Counting):
        def optimise(self, problem, count, seed):
            batch = super().optimise(problem, count, seed)
            return replace(batch, coefficients=batch.coefficients[:1], fitness=batch.fitness[:1])

    method = Lazy()
    assert len(made(planar_problem, tmp_path, method=method, count=3)) == 3
    assert method.calls == 3


@pytest.mark.parametrize("enough", [None, 2, 3])
def test_fewer_seeds_do_where_they_are_enough(planar_problem, tmp_path, caplog, enough):
    class Scarce(Counting):
        def optimise(self, problem, count, seed):
            batch = super().optimise(problem, count, seed)
            found = 2 if self.calls == 1 else 0
            return replace(batch, coefficients=batch.coefficients[:found], fitness=batch.fitness[:found])

    tasks, random = Tasks(4, 2, tmp_path, 1, enough), np.random.SeedSequence(4)
    if enough == 2:
        assert len(make_seeds(planar_problem, Scarce(), tasks, random)) == 2
        assert "only 2 of 4 seeds became valid" in caplog.text
    else:
        with pytest.raises(InfeasibleError, match="only 2 of 4 seeds became valid"):
            make_seeds(planar_problem, Scarce(), tasks, random)


def test_too_few_seeds_say_how_many_and_why(planar_problem, tmp_path, monkeypatch):
    monkeypatch.setattr(result, "HOPELESS", 1.0)
    with pytest.raises(InfeasibleError, match=r"only 0 of 2 seeds became valid .* condition number"):
        made(planar_problem, tmp_path, method=Gradient(5, attempts=5, reserve=0.2), count=2)


def test_the_long_trajectory_is_the_best_of_its_starts_whatever_the_time(planar_problem):
    problem = replace(planar_problem, trajectory=Trajectory(2, 6, 32.0), samples=64)
    shares = []
    method = replace(METHOD, attempts=1)
    one = make_long(problem, method, 1, np.random.SeedSequence(1), lambda *share: shares.append(share))
    assert one.attempts == 1 and shares == [(1, 1)]
    four = make_long(problem, method, 4, np.random.SeedSequence(1), lambda *_: None)
    again = make_long(problem, method, 4, np.random.SeedSequence(1), lambda *_: None)
    assert four.attempts == again.attempts == 4
    assert torch.equal(four.coefficients, again.coefficients)  # the same computation on one machine
    assert float(four.fitness[0]) <= float(one.fitness[0])


@pytest.mark.parametrize("method", [METHOD, PAPER], ids=["gradient", "paper"])
def test_a_long_trajectory_is_what_the_optimiser_of_the_seeds_makes_of_it(planar_problem, method):
    problem = replace(planar_problem, trajectory=Trajectory(2, 6, 32.0), samples=64)
    single, random = replace(method, attempts=1), np.random.SeedSequence(3)
    long = make_long(problem, single, 2, random, lambda *_: None)
    found = [single.optimise(problem, 1, seed) for seed in np.random.SeedSequence(3).spawn(long.attempts)]
    best = min((one for one in found if len(one)), key=lambda one: float(one.fitness[0]))
    assert torch.equal(long.coefficients, best.coefficients)
    assert check(problem.constraints, problem.trajectory, long.coefficients).valid.all()


def test_a_long_trajectory_that_never_becomes_valid_ends_with_the_reason(planar_problem, monkeypatch):
    monkeypatch.setattr(result, "HOPELESS", 1.0)
    method = Counting(replace(METHOD, attempts=1, steps=3))
    with pytest.raises(InfeasibleError, match=r"only 0 of 1 seeds became valid in 10 starts"):
        make_long(planar_problem, method, 2, np.random.SeedSequence(0), lambda *_: None)
    assert method.calls == 10


@pytest.mark.parametrize(
    ("faults", "remedy"),
    [
        ({"velocity of elbow": 2, "torque of elbow": 9}, r"robot\.limits\.effort=\{…\}"),
        ({"collision of base – forearm": 2}, "workspace.clearance=0"),
        ({"keep_out of forearm in region 0": 2}, "workspace=free"),
        ({"acceleration of elbow": 2}, "trajectory.period=…"),
        ({}, "trajectory.period=…"),
    ],
)
def test_too_few_seeds_come_with_what_may_help(faults, remedy):
    nothing = torch.zeros(0, 2, 3, 2)
    error = result.SeedBatch(nothing, nothing[:, 0, 0, 0], 12, 12, faults).shortfall(6)
    with pytest.raises(InfeasibleError, match=rf"what may help: another home .*trajectory\.home=.*{remedy}"):
        raise error


COMMON = {"fitness": "eigenvalue", "count": 4, "samples": 20, "batch": 2, "steps": 7, "attempts": 2}


def test_settings_give_the_optimiser_and_its_problem(planar_problem):
    gradient = Seeds("gradient", **COMMON, reserve=0.3)
    assert gradient.optimiser == Gradient(7, 2, 0.3)
    paper = Seeds("paper", **{**COMMON, "fitness": "diagonal"}, ants=30, evaluations=9)
    assert paper.optimiser == Paper(generations=7, ants=30, evaluations=9, attempts=2)
    assert (gradient.single, paper.single) == (Gradient(7, 1, 0.3), replace(paper.optimiser, attempts=1))
    assert (gradient.evaluations_per_start, paper.evaluations_per_start) == (7, 7 * 30 + 9)
    of = planar_problem.constraints, planar_problem.trajectory
    assert [x.problem(*of).diagonal for x in (gradient, paper)] == [False, True]
    assert gradient.problem(*of).samples == 20


@pytest.mark.parametrize(
    ("method", "options", "message"),
    [
        ("paper", {"ants": 30}, "method paper needs ants and evaluations"),
        ("gradient", {"reserve": 0.2, "ants": 30}, "ants and evaluations are of method paper"),
        ("compiled", {}, "methods gradient and compiled, and no others, need reserve"),
        ("gradient", {}, "methods gradient and compiled, and no others, need reserve"),
        ("paper", {"ants": 3, "evaluations": 9, "reserve": 0.2}, "methods gradient and compiled"),
    ],
)
def test_settings_of_another_method_are_refused(method, options, message):
    with pytest.raises(ConfigError, match=message):
        Seeds(method, **COMMON, **options)
