"""Stage identification: the arm identified from each excitation set, and test torques predicted."""

from functools import partial
from pathlib import Path

import pandas as pd

from sidegan.base.storage import write_parquet
from sidegan.identification import study
from sidegan.pipeline.graph import Artifact, Build, Metrics
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.pools import ExcitationSet
from sidegan.pipeline.stages.random import test_trajectories
from sidegan.pipeline.stages.selection import excitation_sets
from sidegan.pipeline.task import EXPECTED, FACTS, RESULTS, Task
from sidegan.report.tables import arrow


def identification(task: Task, one: ExcitationSet) -> Artifact:
    """Errors of identification from one set."""
    return task.artifact(
        "identification",
        one.name,
        partial(_make, one=one),
        task.cfg.identification,
        {one.source.maker: one.source},
        training=one.training,
        title=f"nmse/{one.title}",
        metrics=mean_errors,
    )


def mean_errors(folder: Path) -> Metrics:
    """Mean nMSE over joints and noise draws, unweighted and weighted."""
    mean = pd.read_parquet(folder / RESULTS).groupby("weighted").nmse.mean()
    names = {False: "unweighted", True: "weighted"}
    return {names[bool(key)]: float(value) for key, value in mean.items()}


def _make(task: Task, build: Build, one: ExcitationSet) -> None:
    settings = task.cfg.identification
    tests = task.trajectory, test_trajectories(task)
    family, random = (one.family, task.load(one.source).coefficients), task.random("identification")
    frames = study.compare(task.body, {one.name: family}, tests, settings, random, build.report)
    expected = study.expected_errors(task.body, family, tests, settings).assign(set=one.name)
    for file, frame in zip((RESULTS, FACTS, EXPECTED), (*frames, expected)):
        write_parquet(build.folder / file, arrow(frame.assign(training=one.training or 0)))


STAGE = Stage(lambda task: [identification(task, one) for one in excitation_sets(task)])
