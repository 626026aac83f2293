"""Stage identification: identify the arm from each excitation set, and predict test torques."""

from functools import partial
from pathlib import Path

import pandas as pd
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import write_parquet
from sidegan.identification import study
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import FACTS, LONG, RESULTS, Task, study_settings
from sidegan.pipeline.stages.common import load, produce_all
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.tracking import Tracker
from sidegan.report.tables import arrow


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Compare all sets."""
    task = Task(cfg, store)
    wanted = task.sets()
    stamps = [task.identification(*one) for one in wanted]
    produce_all(task, "identification (%)", stamps, [partial(_make, task, *one) for one in wanted])
    for one, stamp in zip(wanted, stamps):
        mean = pd.read_parquet(store.require(stamp) / RESULTS).groupby("weighted").nmse.mean()
        names = {False: "unweighted", True: "weighted"}
        title = task.named(*one)
        tracker.log_metrics({f"nmse/{title}/{names[bool(key)]}": value for key, value in mean.items()})


def _make(task: Task, name: str, training: int, folder: Path, work: Path, report: Report) -> None:
    settings = task.cfg.identification
    tests = random_valid(task, settings.tests, "tests")[0]
    parts = study.compare(
        task.body,
        {name: excitation_set(task, name, training)},
        (task.trajectory, tests),
        study_settings(settings),
        task.random("identification"),
        report,
    )
    for file, frame in zip((RESULTS, FACTS), parts):
        write_parquet(folder / file, arrow(frame.assign(training=training)))


def excitation_set(task: Task, name: str, training: int) -> tuple[Trajectory, Tensor]:
    """Family and coefficients (N, J, H, 2) of a set that is compared."""
    if name.startswith(LONG):
        harmonics = int(name.removeprefix(LONG))
        return task.long_trajectory(harmonics), load(task, task.long(harmonics)).coefficients
    return task.trajectory, load(task, task.selection(name, training)).coefficients
