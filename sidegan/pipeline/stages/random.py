"""Stage random: valid trajectories that nobody optimised, the baseline of everything else."""

import logging
from functools import partial
from pathlib import Path

import torch
from torch import Tensor

from sidegan.base.storage import read_json, write_json
from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import LIBRARY, REPORT, Task
from sidegan.pipeline.stages.common import measured, numbers, summary, words
from sidegan.pipeline.tracking import Tracker
from sidegan.validity import check

log = logging.getLogger(__name__)

REACH = 0.8  # of the tightest joint limit, that a random trajectory uses
_TRIES = 1000


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Draw random valid trajectories."""
    task = Task(cfg, store)
    folder = store.produce(task.random_set, partial(_make, task))
    facts = numbers(read_json(folder / REPORT))
    log.info("random: %s", words(facts))
    tracker.log_metrics({f"random/{key}": value for key, value in facts.items()})


def random_valid(task: Task, count: int, purpose: str) -> tuple[Tensor, int]:
    """Coefficients of ``count`` random valid trajectories, (count, J, H, 2), and how many were drawn.

    Raises:
        InfeasibleError: when random trajectories are almost never valid.
    """
    problem = Problem(task.constraints, task.trajectory)
    generator = torch.Generator().manual_seed(task.number(purpose))
    found: list[Tensor] = []
    drawn = 0
    for _ in range(_TRIES):
        c = problem.start(count, generator, REACH)
        found.append(c[check(task.constraints, task.trajectory, c).valid])
        drawn += len(c)
        if sum(map(len, found)) >= count:
            return torch.cat(found)[:count], drawn
    raise InfeasibleError("random trajectories are almost never valid in this workspace")


def _make(task: Task, folder: Path, work: Path) -> None:
    count = task.cfg.library.count
    c, drawn = random_valid(task, count, "random set")
    library = measured(task.constraints, task.trajectory, c, "random")
    library.save(folder / LIBRARY)
    write_json(folder / REPORT, {**summary(library), "drawn": drawn, "valid_share": count / drawn})
