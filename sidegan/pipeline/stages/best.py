"""Stage best: what the best set of every pool is worth, picked from that pool alone in two ways."""

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from sidegan.base.storage import write_json, write_parquet
from sidegan.design.criteria import criteria_of
from sidegan.design.greedy import greedy
from sidegan.design.information import Information, information_of
from sidegan.design.optimal import d_optimal
from sidegan.identification import study
from sidegan.library import Library
from sidegan.library.measure import effort, summary
from sidegan.pipeline.graph import Artifact, Build, Metrics
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.narrow import NARROW, narrow
from sidegan.pipeline.stages.optimised import OPTIMISED, optimised
from sidegan.pipeline.stages.polish import POLISHED, polished
from sidegan.pipeline.stages.pools import Pool, own_pools
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.stages.training import title
from sidegan.pipeline.task import FACTS, REPORT, RESULTS, Task
from sidegan.report.tables import arrow

GREEDY, OPTIMAL = "greedy", "D-optimal"  # ways to pick a set
_RATE = 5.0  # [Hz] at which information is taken


def all_pools(task: Task) -> list[Pool]:
    """Every pool that is compared beyond the paper."""
    finished = [
        Pool(POLISHED, training, title(task, POLISHED, training), (polished(task, training),))
        for training in task.cfg.trainings
    ]
    plain = {OPTIMISED: optimised(task), NARROW: narrow(task)}
    return [*(Pool(name, None, name, (one,)) for name, one in plain.items()), *own_pools(task), *finished]


def best_sets(task: Task, pool: Pool) -> Artifact:
    """What the best sets of one pool are worth."""
    settings = {**asdict(task.cfg.identification), "repeats": task.cfg.beyond.repeats}
    settings |= {"count": task.cfg.selection.count, "evaluation": task.cfg.scale.evaluation}
    return task.artifact(
        "best",
        pool.name,
        partial(_make, pool=pool),
        settings,
        {"pool": pool.parts[0]},
        training=pool.training,
        title=f"best/{pool.title}",
        metrics=_metrics,
    )


def _metrics(folder: Path) -> Metrics:
    """Stacked condition number of each set."""
    facts = pd.read_parquet(folder / FACTS)
    return {f"{pick}/condition": number for pick, number in zip(facts["pick"], facts.condition)}


def _make(task: Task, build: Build, pool: Pool) -> None:
    library = pool.load(task)
    samples = max(round(task.trajectory.period * _RATE), 4 * task.trajectory.harmonics)
    information = information_of(task.body, task.trajectory, library.coefficients, samples)
    count = min(task.cfg.selection.count, len(library))
    picks = {GREEDY: greedy(library.diagonal, count), OPTIMAL: d_optimal(information, count)}
    settings = task.cfg.identification
    results, facts = study.compare(
        task.body,
        {pick: (task.trajectory, library.coefficients[chosen]) for pick, chosen in picks.items()},
        (task.trajectory, random_valid(task, settings.tests, "tests").coefficients),
        replace(settings, repeats=task.cfg.beyond.repeats),
        task.random("identification"),
        build.report,
    )
    facts = facts.groupby("set")[["condition", "covariance_norm"]].mean().rename_axis("pick").reset_index()
    worth = {pick: _worth(task, library, information, chosen) for pick, chosen in picks.items()}
    facts = facts.join(pd.DataFrame.from_dict(worth, orient="index"), on="pick")
    tags: dict[str, Any] = {"name": pool.name, "training": pool.training or 0}
    write_parquet(build.folder / RESULTS, arrow(results.rename(columns={"set": "pick"}).assign(**tags)))
    write_parquet(build.folder / FACTS, arrow(facts.assign(**tags)))
    few = library.take(range(min(len(library), task.cfg.scale.evaluation)))  # rank depends on the number
    write_json(build.folder / REPORT, {**tags, **summary(few), "best": float(library.fitness.min())})


def _worth(task: Task, library: Library, information: Information, chosen: Any) -> dict[str, float]:
    """Log determinant of a set, and what it costs the arm."""
    energy, speed = effort(task.body, task.trajectory, library.coefficients[chosen])
    return {
        "log_det": criteria_of(information.stacked(chosen)).log_det,
        "energy": float(energy.mean()),
        "speed": float(speed.mean()),
    }


STAGE = Stage(lambda task: [best_sets(task, pool) for pool in all_pools(task)])
