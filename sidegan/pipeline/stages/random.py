"""Stage random: valid trajectories that nobody optimised, the baseline of everything else."""

import torch

from sidegan.base.storage import write_json
from sidegan.errors import InfeasibleError
from sidegan.library.draw import Draws, draw_valid
from sidegan.library.measure import measured, summary
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task

REACH = 0.8  # of the tightest joint limit, that a random trajectory uses
_TRIES = 1000


def random_set(task: Task) -> Artifact:
    """Random valid trajectories, as many as a generator's library has."""
    settings = {"count": task.cfg.library.count}
    return task.artifact("random", "random", _make, settings, alone=True)


def random_valid(task: Task, count: int, purpose: str, reach: float = REACH) -> Draws:
    """Random valid trajectories, (count, J, H, 2), and how many were drawn for them.

    Every joint uses ``reach`` of its tightest position or velocity limit.

    Raises:
        InfeasibleError: when random trajectories are almost never valid.
    """
    generator = torch.Generator().manual_seed(task.number(purpose))
    draws = draw_valid(
        lambda n: task.problem.start(n, generator, reach), task.check, count, count, _TRIES * count
    )
    if draws.valid < count:
        raise InfeasibleError("random trajectories are almost never valid in this workspace")
    return draws


def _make(task: Task, build: Build) -> None:
    count = task.cfg.library.count
    draws = random_valid(task, count, "random set")
    library = measured(task.constraints, task.trajectory, draws.coefficients, "random")
    library.save(build.folder / LIBRARY)
    share = {"drawn": draws.drawn, "valid_share": count / draws.drawn}
    write_json(build.folder / REPORT, {**summary(library), **share})


STAGE = Stage(lambda task: [random_set(task)], columnwise=True)
