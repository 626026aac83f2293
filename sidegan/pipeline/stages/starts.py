"""Stage starts: what designs start from, made once for an arm in its workspace."""

import numpy as np

from sidegan.base.storage import write_json
from sidegan.designer import Starts, make_starts
from sidegan.designer.scene import ArmNumbers
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import REPORT, Task

FILE = "starts.pt"


def starts(task: Task) -> Artifact:
    """The starts of the configured designer."""
    return task.artifact("starts", "starts", _make, task.cfg.designer)


def load(task: Task) -> Starts:
    """Starts that must be there."""
    return Starts.load(task.store.require(starts(task)) / FILE, ArmNumbers(task.constraints, task.trajectory))


def _make(task: Task, build: Build) -> None:
    made = make_starts(
        task.constraints, task.trajectory, task.cfg.designer, task.random("starts"), build.report
    )
    made.save(build.folder / FILE, ArmNumbers(task.constraints, task.trajectory))
    condition = np.exp(np.quantile(made.goal, [0.1, 0.5, 0.9])).tolist()
    names = ("best", "condition", "worst")
    write_json(build.folder / REPORT, {"count": len(made), **dict(zip(names, condition))})


STAGE = Stage(lambda task: [starts(task)])
