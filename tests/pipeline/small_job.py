"""A small job in the manner of a stage: seeds of planar2 by tasks, kept as an artifact."""

import json
from pathlib import Path

import numpy as np

from sidegan.base.storage import read_arrays, write_arrays, write_json
from sidegan.design.problem import Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.store import Store
from sidegan.robot import load_robot
from sidegan.seeding import Gradient, make_seeds
from sidegan.validity import Constraints

METHOD = Gradient(steps=10, attempts=5, reserve=0.2)
COUNT, BATCH = 12, 2


def run(root, method=METHOD, workers=1):
    """Folder of the artifact."""
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
