"""Seeds by tasks, long trajectories, and what is said when too few become valid."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.design.search import Descent
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.seeding import Gradient, SeedBatch, Seeds, make_long, make_seeds, optimise, refuse_beyond
from sidegan.validity import check
from tests.refusals import refused
from tests.seeding.conftest import METHODS

METHOD = METHODS["gradient"]


def made(problem, work, workers=1, method=METHOD, count=5):
    return make_seeds(problem, method, count, np.random.SeedSequence(4), batch=2, work=work, workers=workers)


class Spied:
    """Counts its tasks, and keeps at most as many seeds of each as told."""

    def __init__(self, method=METHOD, most=9):
        self.calls, self.method, self.most = 0, method, most

    def optimise(self, problem, count, seed):
        self.calls += 1
        return self.method.optimise(problem, count, seed).best(self.most)


@pytest.mark.parametrize("name", METHODS)
def test_workers_do_not_change_seeds_and_damaged_tasks_are_redone(planar_problem, tmp_path, name):
    work = tmp_path / "one"
    batch = made(planar_problem, work, 1, METHODS[name])
    assert check(planar_problem.constraints, planar_problem.trajectory, batch.coefficients).valid.all()
    other = made(planar_problem, tmp_path / "two", 2, METHODS[name])
    assert np.array_equal(batch.coefficients, other.coefficients)
    files = sorted(work.iterdir())
    assert len(files) == 3
    files[0].unlink()
    files[1].write_bytes(files[1].read_bytes()[:100])
    method = Spied(METHODS[name])
    assert np.array_equal(batch.coefficients, made(planar_problem, work, method=method).coefficients)
    assert method.calls == 2


def test_failed_starts_are_replaced(planar_problem, tmp_path):
    method = Spied(most=1)
    assert len(made(planar_problem, tmp_path, method=method, count=3)) == method.calls == 3


def test_a_search_that_ends_at_nan_is_started_again(planar_problem, tmp_path, monkeypatch):
    run, runs = Descent.run, []

    def half(self, *start):
        runs.append(start)
        return run(self, *start) * (np.nan if len(runs) % 2 else 1.0)

    monkeypatch.setattr(Descent, "run", half)
    assert np.isfinite(made(planar_problem, tmp_path).fitness).all()


def test_a_long_trajectory_is_the_best_of_its_starts(planar_problem):
    problem = replace(planar_problem, trajectory=Trajectory(2, 6, 32.0), samples=64)
    single, seed = replace(METHOD, attempts=1), np.random.SeedSequence
    long = make_long(problem, single, 2, seed(3), workers=1)
    found = [single.optimise(problem, 1, child) for child in seed(3).spawn(long.attempts)]
    best = min((batch for batch in found if len(batch)), key=lambda batch: float(batch.fitness[0]))
    assert np.array_equal(long.coefficients, best.coefficients)
    assert check(problem.constraints, problem.trajectory, long.coefficients).valid.all()


def test_seeds_that_never_become_valid_are_reported_with_the_reason(planar_problem, tmp_path, monkeypatch):
    monkeypatch.setattr(optimise, "HOPELESS", 1.0)
    with refused(InfeasibleError, "0 of 2", "condition number"):
        made(planar_problem, tmp_path, method=Gradient(5, attempts=5, reserve=0.2), count=2)
    method = Spied(replace(METHOD, attempts=1, steps=3))
    with refused(InfeasibleError, "0 of 1", "10 starts"):
        make_long(planar_problem, method, 2, np.random.SeedSequence(0), workers=1)
    assert method.calls == 10


@pytest.mark.parametrize(
    ("faults", "remedy"),
    [
        ({"velocity of elbow": 2, "torque of elbow": 9}, "masses that are right"),
        ({"keep_out of forearm in region 0": 2}, "workspace={'desk': None}"),
        ({}, "(period=…)"),
    ],
)
def test_too_few_seeds_are_reported_with_suggestions(planar_problem, faults, remedy):
    nothing = np.zeros((0, 2, 3, 2))
    error = SeedBatch(nothing, nothing[:, 0, 0, 0], 12, 12, faults).shortfall(planar_problem.constraints, 6)
    with refused(InfeasibleError, "(home=[…])", remedy):
        raise error


def test_the_folder_only_stamps_published_seeds():
    paper = Seeds(method="paper", count=4, steps=5, ants=30, evaluations=9, box=0.2)
    assert paper.stamped() == replace(paper, folder="there", shipped="seeds.npz").stamped()


@pytest.mark.parametrize(
    ("names", "method", "options"),
    [
        (["paper", "evaluations"], "paper", {"ants": 30, "box": 0.2}),
        (["ants, box, evaluations", "seeds=paper", "settings={'method': 'paper'}"], "paper", {}),
        (["'papers'", "gradient, paper, published"], "papers", {}),
        (["gradient", "ants"], "gradient", {"reserve": 0.2, "ants": 30}),
        (["gradient", "strongest"], "gradient", {"reserve": 0.2, "strongest": 35}),
        (["published", "reserve"], "published", {"reserve": 0.1}),
        (["folder", "git clone https://"], "published", {}),
    ],
)
def test_settings_of_another_method_are_refused(names, method, options):
    with refused(ConfigError, *names):
        Seeds(method=method, count=4, steps=5, **options)


def test_seeds_must_fit_the_box_of_their_generators():
    refuse_beyond(np.array([0.2 * (1 + 1e-7), -0.1]), 0.2)
    refuse_beyond(np.array([9.0]), None)
    with refused(ConfigError, "0.3 rad/s", "0.2", "seeds.box=null"):
        refuse_beyond(np.array([-0.3, 0.1]), 0.2)
