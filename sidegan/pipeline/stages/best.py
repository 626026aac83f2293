"""Stage best: what the best set of every pool is worth, picked from that pool alone in two ways."""

import logging
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import write_json, write_parquet
from sidegan.design.criteria import criteria_of
from sidegan.design.greedy import greedy
from sidegan.design.information import Information, information_of
from sidegan.design.optimal import d_optimal
from sidegan.identification import study
from sidegan.library import Library
from sidegan.library.measure import effort
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import FACTS, REPORT, RESULTS, Task, study_settings
from sidegan.pipeline.stages.common import load, produce_all, summary
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.tracking import Tracker
from sidegan.report.tables import arrow

log = logging.getLogger(__name__)

_RATE = 5.0  # [Hz] at which information is taken


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Pick, execute and identify from the best set of every pool."""
    judge(Task(cfg, store), plan_beyond.pools(Task(cfg, store)), tracker)


def judge(task: Task, wanted: list[tuple[str, int]], tracker: Tracker) -> None:
    """Make and tell what the best sets of some pools are worth."""
    stamps = [plan_beyond.best(task, *one) for one in wanted]
    produce_all(task, "best sets (%)", stamps, [partial(_make, task, *one) for one in wanted])
    for one, stamp in zip(wanted, stamps):
        facts = pd.read_parquet(task.store.require(stamp) / FACTS)
        title = plan_beyond.titled(task, *one)
        for row in facts.to_dict("records"):
            log.info("best of %s, %s: stacked cond %.4g", title, row["pick"], row["condition"])
            tracker.log_metrics({f"best/{title}/{row['pick']}/condition": row["condition"]})


def _make(task: Task, name: str, training: int, folder: Path, work: Path, report: Report) -> None:
    pool = load(task, plan_beyond.pool(task, name, training))
    about = information(task, pool.coefficients)
    sets = picks(pool, about, task.cfg.selection.count)
    settings = task.cfg.identification
    results, known = study.compare(
        task.body,
        {pick: (task.trajectory, pool.coefficients[chosen]) for pick, chosen in sets.items()},
        (task.trajectory, random_valid(task, settings.tests, "tests")[0]),
        replace(study_settings(settings), repeats=task.cfg.beyond.repeats),
        task.random("identification"),
        report,
    )
    facts = known.groupby("set")[["condition", "covariance_norm"]].mean().rename_axis("pick").reset_index()
    told = {pick: _told(task, pool, about, chosen) for pick, chosen in sets.items()}
    facts = facts.join(pd.DataFrame.from_dict(told, orient="index"), on="pick")
    tags: dict[str, Any] = {"name": name, "training": training}
    write_parquet(folder / RESULTS, arrow(results.rename(columns={"set": "pick"}).assign(**tags)))
    write_parquet(folder / FACTS, arrow(facts.assign(**tags)))
    few = pool.take(range(min(len(pool), task.cfg.scale.evaluation)))  # rank depends on the number
    write_json(folder / REPORT, {**tags, **summary(few), "best": float(pool.fitness.min())})


def information(task: Task, c: Tensor) -> Information:
    """Information of trajectories (N, J, H, 2)."""
    samples = max(round(task.trajectory.period * _RATE), 4 * task.trajectory.harmonics)
    return information_of(task.body, task.trajectory, c, samples)


def picks(pool: Library, about: Information, count: int) -> dict[str, Tensor]:
    """Indices (count,) of the paper's pick and of the D-optimal one, by name."""
    count = min(count, len(pool))
    return {plan_beyond.GREEDY: greedy(pool.diagonal, count), plan_beyond.OPTIMAL: d_optimal(about, count)}


def _told(task: Task, pool: Library, about: Information, chosen: Tensor) -> dict[str, float]:
    """Log determinant of a set, and what it costs the arm."""
    energy, speed = effort(task.body, task.trajectory, pool.coefficients[chosen])
    return {
        "log_det": criteria_of(about.stacked(chosen)).log_det,
        "energy": float(energy.mean()),
        "speed": float(speed.mean()),
    }
