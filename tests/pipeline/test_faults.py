"""What goes wrong on real machines, at a small size: nothing is lost, and what happened is said."""

import json
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from sidegan.base import parallel
from sidegan.base.storage import read_arrays, write_arrays, write_json
from sidegan.design.problem import Problem
from sidegan.design.search import Descent
from sidegan.errors import SideganError
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.store import Store
from sidegan.robot import load_robot
from sidegan.seeding import Gradient, make_seeds
from sidegan.validity import Constraints

METHOD = Gradient(steps=10, attempts=5, reserve=0.2)
COUNT, BATCH = 12, 2


def made_by(root, method=METHOD, workers=1):
    """Folder of an artifact made in the manner of a stage: seeds of planar2 by tasks."""
    problem = Problem(Constraints(load_robot("planar2"), []), Trajectory(2, 3, 8.0), samples=20)

    def make(build):
        tasks = {"batch": BATCH, "work": build.work, "workers": workers}
        batch = make_seeds(problem, method, COUNT, np.random.SeedSequence(4), **tasks)
        write_arrays(build.folder / "seeds.npz", {"c": batch.coefficients, "fitness": batch.fitness})
        write_json(build.folder / "report.json", {"attempts": batch.attempts, "failed": batch.failed})

    named = {"maker": "seeds", "label": "planar2", "title": "seeds", "metrics": lambda folder: {}}
    artifact = Artifact(**named, settings={"count": COUNT}, inputs={}, seed=4, make=make)
    return Store(Path(root)).produce(artifact)


def same(first, other):
    """Whether two artifacts hold the same to the last bit."""
    left, right = read_arrays(first / "seeds.npz"), read_arrays(other / "seeds.npz")
    reports = [json.loads((folder / "report.json").read_text()) for folder in (first, other)]
    return all(np.array_equal(left[key], right[key]) for key in right) and reports[0] == reports[1]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The artifact of a run in which nothing went wrong."""
    return made_by(tmp_path_factory.mktemp("undisturbed"))


@dataclass(frozen=True)
class Watched:
    """The small job's optimiser; before each task somebody is told its number."""

    before: Callable[[int], object]

    def optimise(self, problem, count, seed):
        self.before(seed.spawn_key[-1])
        return METHOD.optimise(problem, count, seed)


def die_once(marker, task):
    """Kill this process at the fourth task."""
    if task == 3 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_worker_is_reported_and_a_rerun_continues(tmp_path, undisturbed):
    deadly, redone = Watched(partial(die_once, tmp_path / "died")), []
    with pytest.raises(SideganError, match=r"seeds: a worker process was killed.*the same command continues"):
        made_by(tmp_path, deadly, workers=2)
    done = list(tmp_path.glob("seeds/*.work/seeds-*.npz"))
    assert done and same(made_by(tmp_path, Watched(redone.append)), undisturbed)
    assert len(redone) == COUNT // BATCH - len(done)


def test_an_interrupt_stops_the_workers_quietly(monkeypatch, recwarn):
    failed = []

    def nap(report):  # defined here, so that workers need not import what this file does
        time.sleep(0.2)

    @contextmanager
    def interrupted(*arguments):
        def progress(done):
            raise KeyboardInterrupt

        yield progress

    monkeypatch.setattr(threading, "excepthook", failed.append)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(parallel, "bar", interrupted)
        parallel.run_jobs("naps", [nap] * 50, 2)  # many more than workers take at a time
    assert parallel.run_jobs("after", [nap] * 3, 2) == [None] * 3
    assert not failed and not recwarn.list


def test_a_search_that_ends_at_nan_is_started_again(tmp_path, monkeypatch):
    run, runs = Descent.run, []

    def half(self, *start):
        runs.append(start)
        return run(self, *start) * (np.nan if len(runs) % 2 else 1.0)

    monkeypatch.setattr(Descent, "run", half)
    made = read_arrays(made_by(tmp_path) / "seeds.npz")
    assert len(made["c"]) == COUNT
    assert np.isfinite(made["c"]).all() and np.isfinite(made["fitness"]).all()
