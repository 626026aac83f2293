"""Stage library: valid trajectories of each generator."""

import logging
from functools import partial

import torch
from torch import Tensor

from sidegan.base.storage import write_json
from sidegan.library import Library
from sidegan.library.draw import draw_valid
from sidegan.library.measure import measured, summary
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generator, generators
from sidegan.pipeline.task import GENERATOR, LIBRARY, REPORT, Task

log = logging.getLogger(__name__)

_TOGETHER = 20_000  # trajectories of a library and the seeds whose diversity is looked at


def library(task: Task, name: str, training: int) -> Artifact:
    """The valid trajectories of one generator."""
    inputs = {"gan": generator(task, name, training)}
    if task.cfg.gan[name].seeded:
        inputs["seeds"] = seed_set(task)  # for the diversity of both together
    return task.artifact(
        "library",
        name,
        partial(_make, name=name, training=training),
        task.cfg.library,
        inputs,
        training=training,
    )


def _make(task: Task, build: Build, name: str, training: int) -> None:
    from sidegan.gan import TrajectoryGenerator

    settings = task.cfg.library
    path = task.store.require(generator(task, name, training)) / GENERATOR
    network = TrajectoryGenerator.load(path, task.arm)
    noise = torch.Generator().manual_seed(task.number(f"library {name}", training))

    def sample(count: int) -> Tensor:
        return network.sample(count, noise)

    draws = draw_valid(sample, task.check, settings, f"drawn from {name}", build.report)
    made = measured(task.constraints, task.trajectory, draws.coefficients, name)
    made.save(build.folder / LIBRARY)
    facts = summary(made) if len(made) else {"count": 0}
    facts = {key: x for key, x in facts.items() if key != "valid"}
    if task.cfg.gan[name].seeded:
        facts |= _union(task, made, noise)
    share = {"drawn": draws.drawn, "valid_share": draws.valid / draws.drawn}
    write_json(build.folder / REPORT, share | facts)


def _union(task: Task, made: Library, noise: torch.Generator) -> dict[str, float]:
    """Diversity of the library and the seeds put together."""
    seeds = task.load(seed_set(task))
    order = torch.randperm(len(seeds) + len(made), generator=noise)[:_TOGETHER]
    of_seeds = order < len(seeds)
    both = seeds.take(order[of_seeds]).merge(made.take(order[~of_seeds] - len(seeds)))
    shuffled = summary(both.take(of_seeds.logical_not().argsort(stable=True).argsort()))
    return {f"union_{key}": shuffled[key] for key in ("distance", "distance_diagonal", "rank")}


STAGES = {
    "library": Stage(
        lambda task: [library(task, *one) for one in generators(task)],
        check=lambda task: task.require_room(task.cfg.library.count, "library.count"),
    )
}
