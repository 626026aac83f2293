"""Seeds by tasks, long trajectories, and what is said when too few become valid."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.design.search import Descent
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.seeding import Gradient, Seeds, make_long, make_seeds, refuse_beyond, result
from sidegan.validity import check
from tests.seeding.conftest import METHODS

METHOD = METHODS["gradient"]


def made(problem, work, workers=1, method=METHOD, count=5):
    return make_seeds(problem, method, count, np.random.SeedSequence(4), batch=2, work=work, workers=workers)


class Spied:
    """Counts its tasks, and does something to what each of them finds."""

    def __init__(self, method=METHOD, then=lambda calls, batch: batch):
        self.calls, self.method, self.then = 0, method, then

    def optimise(self, problem, count, seed):
        self.calls += 1
        return self.then(self.calls, self.method.optimise(problem, count, seed))


def first(batch, count):
    return replace(batch, coefficients=batch.coefficients[:count], fitness=batch.fitness[:count])


@pytest.mark.parametrize("name", METHODS)
def test_workers_do_not_change_seeds_and_damaged_tasks_are_redone(planar_problem, tmp_path, name):
    work, other = tmp_path / "one", tmp_path / "two"
    work.mkdir()
    other.mkdir()
    batch = made(planar_problem, work, 1, METHODS[name])
    assert check(planar_problem.constraints, planar_problem.trajectory, batch.coefficients).valid.all()
    assert np.array_equal(batch.coefficients, made(planar_problem, other, 2, METHODS[name]).coefficients)
    files = sorted(work.iterdir())
    assert len(files) == 3
    files[0].unlink()
    files[1].write_bytes(files[1].read_bytes()[:100])
    method = Spied(METHODS[name])
    assert np.array_equal(batch.coefficients, made(planar_problem, work, method=method).coefficients)
    assert method.calls == 2


def test_failed_starts_are_replaced(planar_problem, tmp_path):
    method = Spied(then=lambda calls, batch: first(batch, 1))
    assert len(made(planar_problem, tmp_path, method=method, count=3)) == 3
    assert method.calls == 3


def test_a_search_that_ends_at_nan_is_started_again(planar_problem, tmp_path, monkeypatch):
    run, runs = Descent.run, []

    def half(self, *start):
        runs.append(start)
        return run(self, *start) * (np.nan if len(runs) % 2 else 1.0)

    monkeypatch.setattr(Descent, "run", half)
    assert np.isfinite(made(planar_problem, tmp_path).fitness).all()


@pytest.fixture
def long_problem(planar_problem):
    return replace(planar_problem, trajectory=Trajectory(2, 6, 32.0), samples=64)


def test_a_long_trajectory_is_the_best_of_its_starts(long_problem):
    single, seed = replace(METHOD, attempts=1), np.random.SeedSequence
    long = make_long(long_problem, single, 2, seed(3), workers=1)
    found = [single.optimise(long_problem, 1, child) for child in seed(3).spawn(long.attempts)]
    best = min((batch for batch in found if len(batch)), key=lambda batch: float(batch.fitness[0]))
    assert np.array_equal(long.coefficients, best.coefficients)
    assert check(long_problem.constraints, long_problem.trajectory, long.coefficients).valid.all()


def test_seeds_that_never_become_valid_are_reported_with_the_reason(planar_problem, tmp_path, monkeypatch):
    monkeypatch.setattr(result, "HOPELESS", 1.0)
    with pytest.raises(InfeasibleError, match=r"only 0 of 2 seeds became valid .* condition number"):
        made(planar_problem, tmp_path, method=Gradient(5, attempts=5, reserve=0.2), count=2)
    method = Spied(replace(METHOD, attempts=1, steps=3))
    with pytest.raises(InfeasibleError, match=r"only 0 of 1 seeds became valid in 10 starts"):
        make_long(planar_problem, method, 2, np.random.SeedSequence(0), workers=1)
    assert method.calls == 10


@pytest.mark.parametrize(
    ("faults", "remedy"),
    [
        ({"velocity of elbow": 2, "torque of elbow": 9}, r"robot\.limits\.effort=\{elbow: …\}"),
        ({"collision of base – forearm": 2}, "may_touch=\\[\\[base, forearm"),
        ({"keep_out of forearm in region 0": 2}, "workspace=free"),
        ({}, "trajectory.period=…"),
    ],
)
def test_too_few_seeds_are_reported_with_suggestions(planar_problem, faults, remedy):
    nothing = np.zeros((0, 2, 3, 2))
    batch = result.SeedBatch(nothing, nothing[:, 0, 0, 0], 12, 12, faults)
    error = batch.shortfall(planar_problem.constraints, 6)
    with pytest.raises(InfeasibleError, match=rf"what may help: a home .*trajectory\.home=.*{remedy}"):
        raise error


COMMON = {"count": 4, "samples": 20, "batch": 2, "steps": 7, "attempts": 2}


def test_the_folder_only_stamps_published_seeds():
    paper = Seeds(method="paper", **COMMON, ants=30, evaluations=9, box=0.2)
    assert paper.stamped() == replace(paper, folder="there", shipped="seeds.npz").stamped()


@pytest.mark.parametrize(
    ("words", "method", "options"),
    [
        ("method paper needs evaluations", "paper", {"ants": 30, "box": 0.2}),
        (r"needs ants, box, evaluations; .*in Python .*settings={'method': 'paper'}", "paper", {}),
        ("method is 'papers', expected one of gradient, paper, published", "papers", {}),
        ("method gradient does not have ants", "gradient", {"reserve": 0.2, "ants": 30}),
        ("method gradient does not have strongest", "gradient", {"reserve": 0.2, "strongest": 35}),
        ("method published does not have reserve; choose it by seeds=pub", "published", {"reserve": 0.1}),
        ("folder is not set: git clone https://", "published", {}),
    ],
)
def test_settings_of_another_method_are_refused(words, method, options):
    with pytest.raises(ConfigError, match=words):
        Seeds(method=method, **COMMON, **options)


def test_seeds_must_fit_the_box_of_their_generators():
    refuse_beyond(np.array([0.2 * (1 + 1e-7), -0.1]), 0.2)
    with pytest.raises(
        ConfigError, match=r"seeds reach 0\.3 rad/s, beyond the box of 0\.2: .*seeds\.box=null"
    ):
        refuse_beyond(np.array([-0.3, 0.1]), 0.2)
    refuse_beyond(np.array([9.0]), None)
