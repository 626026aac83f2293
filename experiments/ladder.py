"""From the paper's recipe to ours, one change at a time, and what each change brings."""

from pathlib import Path

import pandas as pd

from experiments.pages import Page, means, publish
from experiments.words import COLUMNS
from sidegan.pipeline.stages.ladder import rungs
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import show
from sidegan.report.tables import over_groups


def collect(task: Task) -> Task:
    """The task, whose rungs are read when they are shown."""
    return task


def table(task: Task) -> pd.DataFrame:
    """What the generators of each rung make, over trainings, under the seeds."""
    return over_groups(rows(task), "rung", COLUMNS["ladder"])


def present(task: Task, folder: Path, tracker: Tracker) -> None:
    """Print the table, and write and record the page ``ladder.md``."""
    made = table(task)
    show(made, "From the paper's recipe to ours: of the kept epoch, true physics, no sample filtered")
    page = Page(
        "ladder", {"ladder": made}, {}, means(rows(task), "rung", COLUMNS["ladder"]), {"cfg": task.cfg}
    )
    publish(page, Path(task.cfg.publish or folder), tracker)


def rows(task: Task) -> pd.DataFrame:
    """A row for the seeds, and one per rung and training."""
    rows = [{"rung": "seeds", "success": 1.0, **task.report(seed_set(task))}]
    rows[0]["condition_valid"] = rows[0]["condition"]
    for name, trainings in rungs(task).items():
        rows += [{"rung": name, **task.report(one)} for one in trainings]
    return pd.DataFrame(rows)
