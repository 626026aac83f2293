"""Stage ladder: from the paper's recipe to ours, one change at a time, and what each change brings."""

import pandas as pd

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.ablation import trained
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import needed_surrogates
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import show, write_table
from sidegan.report.tables import over_groups

_COLUMNS = {
    "success": "valid share",
    "condition_valid": "median cond(YᵀY) of the valid",
    "distance": "mean distance",
    "rank": "effective rank",
}
_CAPTION = "From the paper's recipe to ours: of the kept epoch, true physics, no sample filtered"


def rungs(task: Task) -> dict[str, list[Artifact]]:
    """Every training of each rung."""
    return trained(task, task.cfg.ladder, task.cfg.scale.ladder_trainings)


def table(task: Task) -> pd.DataFrame:
    """What the generators of each rung make, over trainings, under the seeds."""
    rows = [{"rung": "seeds", "success": 1.0, **task.report(seed_set(task))}]
    rows[0]["condition_valid"] = rows[0]["condition"]
    for name, trainings in rungs(task).items():
        rows += [{"rung": name, **task.report(one)} for one in trainings]
    return over_groups(pd.DataFrame(rows), "rung", _COLUMNS)


def _show(task: Task, tracker: Tracker) -> None:
    """Print the table and leave it in the run's folder."""
    made = table(task)
    show(made, _CAPTION)
    write_table(made, task.store.run_folder / "ladder", _CAPTION)
    tracker.log_artifact(task.store.run_folder / "ladder.csv", "tables")


STAGE = Stage(
    lambda task: [
        *needed_surrogates(task, task.cfg.ladder.values()),
        *(one for trainings in rungs(task).values() for one in trainings),
    ],
    _show,
)
