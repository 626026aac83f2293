"""Stage first_set: how long it takes to a first set of valid trajectories, on one core."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from torch import Tensor

from sidegan.library.draw import draw_valid
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.pools import RANDOM, SEEDS
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.stages.training import generator, generators, title, training_seeds
from sidegan.pipeline.task import GENERATOR, Task

_TRIES = 1000  # batches of draws
_MANY_DRAWN = 500  # valid trajectories whose drawing tells the time of one
_FEW, _MANY = 5, 45  # steps of the two trainings whose difference tells the time of a step


def first_set(task: Task, name: str, training: int | None) -> Artifact:
    """The time to a first set, by one way; its numbers are costs, since they depend on the machine."""
    settings: dict[str, object] = {"count": task.cfg.selection.count}
    inputs = {} if training is None else {"gan": generator(task, name, training)}
    make = partial(_make, name=name, training=training)
    shown = f"first_set/{title(task, name, training)}"
    return task.artifact(
        "first_set", name, make, settings, inputs, training=training, title=shown, alone=True
    )


def ways(task: Task) -> list[tuple[str, int | None]]:
    """Every way to a first set: name and training."""
    return [(RANDOM, None), (SEEDS, None), *generators(task)]


def _make(task: Task, build: Build, name: str, training: int | None) -> None:
    count = task.cfg.selection.count
    if name == RANDOM:
        build.costs["cpu_seconds"] = _seconds(lambda: random_valid(task, count, "first random set"))
    elif training is None:
        build.costs["cpu_seconds"] = _seconds(lambda: _optimised(task, count))
    else:
        path = task.store.require(generator(task, name, training)) / GENERATOR
        build.costs["cpu_seconds"] = _seconds(lambda: _drawn(task, path, count))
        build.costs["each"] = _seconds(lambda: _drawn(task, path, _MANY_DRAWN)) / _MANY_DRAWN
        if task.cfg.gan[name].exact is not None:
            build.costs["training_seconds"] = _training_seconds(task, name)


def _seconds(work: Callable[[], object]) -> float:
    """CPU time of some work [s]."""
    began = time.process_time()
    work()
    return time.process_time() - began


def _optimised(task: Task, count: int) -> Tensor:
    """So many seeds and no more, (count, J, H, 2)."""
    settings = task.cfg.seeds
    problem = settings.problem(task.constraints, task.trajectory)
    return settings.optimiser.optimise(problem, count, task.random("first seeds")).coefficients


def _drawn(task: Task, path: Path, count: int) -> Tensor:
    """The first valid trajectories of a generator in a file, at most (count, J, H, 2)."""
    from sidegan.gan import TrajectoryGenerator

    network, noise = TrajectoryGenerator.load(path, task.arm), torch.Generator()
    noise.manual_seed(task.number("first set"))
    most = 2 * count * _TRIES
    return draw_valid(lambda n: network.sample(n, noise), task.check, count, 2 * count, most).coefficients


def _training_seconds(task: Task, name: str) -> float:
    """CPU time of one whole training [s], from that of a few of its steps: what others do does not count."""
    from sidegan.gan.training import Run, train_variant

    variant = task.cfg.gan[name]
    seeds = training_seeds(task).coefficients if variant.seeded else None

    def train(steps: int) -> None:
        brief = replace(variant, epochs=1, steps=steps)
        with TemporaryDirectory() as work:
            run = Run(name, 0, Path(work), evaluation=0)
            train_variant(brief, task.constraints, task.trajectory, seeds, run)

    few, many = (_seconds(partial(train, steps)) for steps in (_FEW, _MANY))
    steps = variant.epochs * (variant.steps or 1)
    return few + (steps - _FEW) * (many - few) / (_MANY - _FEW)


STAGE = Stage(lambda task: [first_set(task, *way) for way in ways(task)])
