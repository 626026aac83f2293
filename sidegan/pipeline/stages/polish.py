"""Stage polish: what gradient steps on generated trajectories bring, and what they cost."""

import time
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from torch import Generator, Tensor

from sidegan.base.parallel import Job, Report, run_jobs
from sidegan.base.storage import write_json, write_parquet
from sidegan.design.polish import Polish
from sidegan.errors import ConfigError
from sidegan.gan.metrics import measure
from sidegan.library.draw import draw_valid
from sidegan.library.measure import measured, summary
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.pools import RANDOM
from sidegan.pipeline.stages.training import generator, title
from sidegan.pipeline.task import GENERATOR, LIBRARY, REPORT, RESULTS, Task
from sidegan.report.tables import arrow
from sidegan.seeds import Gradient

POLISHED = "polished"
_SPARE = 8  # drawn beyond what is missing: a few stay invalid
_MOST = 20  # draws per trajectory wanted


def source(task: Task, training: int | None = None) -> Artifact:
    """The generator that is polished and transferred; its first training when None.

    Raises:
        ConfigError: when it is not trained.
    """
    name = task.cfg.beyond.source
    if name not in task.cfg.gan:
        raise ConfigError(f"beyond.source is {name!r}, expected one of gan: {', '.join(task.cfg.gan)}")
    return generator(task, name, task.cfg.trainings[0] if training is None else training)


def polish_curve(task: Task) -> Artifact:
    """Quality against gradient steps; what they took is a cost."""
    settings = {"steps": task.cfg.beyond.steps, "count": task.cfg.beyond.polished}
    inputs = {"gan": source(task)}
    return task.artifact(
        "polish", task.cfg.beyond.source, _curve, settings, inputs, metrics=_metrics, alone=True
    )


def polished(task: Task, training: int) -> Artifact:
    """A library of polished trajectories."""
    settings = {"steps": task.cfg.beyond.finish, "count": task.cfg.seeds.count}
    settings |= {"batch": task.cfg.library.batch, "least": task.cfg.selection.count}
    inputs = {"gan": source(task, training)}
    return task.artifact(
        "polished",
        task.cfg.beyond.source,
        partial(_library, training=training),
        settings,
        inputs,
        training=training,
        title=title(task, POLISHED, training),
    )


def _metrics(folder: Path) -> dict[str, float]:
    rows = pd.read_parquet(folder / RESULTS)
    names = [f"{start}/{steps} steps" for start, steps in zip(rows.start, rows.steps)]
    return dict(zip(names, rows.condition.tolist()))


def _library(task: Task, build: Build, training: int) -> None:
    """As many polished valid trajectories as there are seeds."""
    from sidegan.gan import TrajectoryGenerator

    count, problem = task.cfg.seeds.count, task.problem
    network = TrajectoryGenerator.load(task.store.require(source(task, training)) / GENERATOR, task.arm)
    noise, finish = Generator().manual_seed(task.number("polished", training)), Polish(task.cfg.beyond.finish)
    began = time.process_time()
    draws = draw_valid(
        lambda number: finish.improve(problem, network.sample(number, noise)),
        task.check,
        count,
        task.cfg.library.batch,
        _MOST * count,
        _SPARE,
        build.report,
    ).require(task.cfg.selection.count, f"polished from {task.cfg.beyond.source}")
    build.costs["each"] = (time.process_time() - began) / draws.valid
    library = measured(task.constraints, task.trajectory, draws.coefficients, POLISHED)
    library.save(build.folder / LIBRARY)
    share = {"drawn": draws.drawn, "valid_share": draws.valid / draws.drawn}
    write_json(build.folder / REPORT, share | summary(library))


def _curve(task: Task, build: Build) -> None:
    steps = task.cfg.beyond.steps
    jobs: list[Job] = [partial(_polished, task, number) for number in [0, *steps]]
    jobs += [partial(_optimised, task, number) for number in steps]
    rows = run_jobs("polish (%)", jobs, task.cfg.parallel.workers)
    build.costs["each"] = [row.pop("seconds") for row in rows]
    write_parquet(build.folder / RESULTS, arrow(pd.DataFrame(rows)))


def _polished(task: Task, steps: int, report: Report) -> dict[str, Any]:
    """Quality and cost of generated trajectories after so many steps."""
    from sidegan.gan import TrajectoryGenerator

    problem = task.problem
    network = TrajectoryGenerator.load(task.store.require(source(task)) / GENERATOR, task.arm)
    Polish(1).improve(problem, network.sample(2))  # what is made once does not count
    began = time.process_time()
    c = network.sample(task.cfg.beyond.polished, task.number("polish"))
    if steps:
        c = Polish(steps).improve(problem, c)
    return _row(task, task.cfg.beyond.source, steps, c, time.process_time() - began)


def _optimised(task: Task, steps: int, report: Report) -> dict[str, Any]:
    """The same of the seeds' optimiser from random starts, with the same reserve."""
    count, problem, random = task.cfg.beyond.polished, task.problem, task.random("polish from random")
    reserve = Polish(1).reserve
    Gradient(steps=1, attempts=1, reserve=reserve).optimise(problem, 2, random)
    began = time.process_time()
    batch = Gradient(steps=steps, attempts=1, reserve=reserve).optimise(problem, count, random)
    share = len(batch) / count
    row = _row(task, RANDOM, steps, batch.coefficients, (time.process_time() - began) * share)
    return row | {"success": share}


def _row(task: Task, start: str, steps: int, c: Tensor, spent: float) -> dict[str, Any]:
    """Metrics of trajectories that took so long [s]; of none they are not known."""
    if len(c) < 2:
        return {"start": start, "steps": steps, "seconds": float("nan"), "condition": float("nan")}
    facts = measure(task.constraints, task.trajectory, c)
    return {"start": start, "steps": steps, "seconds": spent / len(c), **facts}


STAGE = Stage(lambda task: [*(polished(task, k) for k in task.cfg.trainings), polish_curve(task)])
