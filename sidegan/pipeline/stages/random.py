"""Stage random: valid trajectories that nobody optimised, the baseline of everything else."""

import torch
from torch import Tensor

from sidegan.base.storage import write_json
from sidegan.library import draw
from sidegan.library.draw import Draws
from sidegan.library.measure import measured, summary
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task

REACH = 0.8  # of the tightest joint limit, that a random trajectory uses


def random_set(task: Task) -> Artifact:
    """Random valid trajectories, as many as a generator's library has."""
    settings = {"count": task.cfg.library.count}
    return task.artifact("random", "random", _make, settings, alone=True)


def random_valid(task: Task, count: int, purpose: str, reach: float = REACH) -> Draws:
    """Random valid trajectories, (count, J, H, 2), of the task's own draws for a purpose."""
    generator = torch.Generator().manual_seed(task.number(purpose))
    return draw.random_valid(task.problem, count, generator, reach)


def test_trajectories(task: Task) -> Tensor:
    """Trajectories whose torques are predicted, (tests, J, H, 2); no set contains or generated them."""
    settings = task.cfg.identification
    return random_valid(task, settings.tests, "tests", settings.reach).coefficients


def _make(task: Task, build: Build) -> None:
    count = task.cfg.library.count
    draws = random_valid(task, count, "random set")
    library = measured(task.constraints, task.trajectory, draws.coefficients, "random")
    library.save(build.folder / LIBRARY)
    share = {"drawn": draws.drawn, "valid_share": count / draws.drawn}
    write_json(build.folder / REPORT, {**summary(library), **share})


STAGE = Stage(lambda task: [random_set(task)])
