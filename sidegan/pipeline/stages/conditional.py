"""Stage conditional: a generator for many conditions; how well they are met, or a library for one."""

import logging
from dataclasses import replace
from functools import partial
from pathlib import Path

import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import read_json, write_json
from sidegan.conditional import Condition, ConditionalGenerator
from sidegan.conditional.study import Study, validity
from sidegan.errors import InfeasibleError
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import GENERATOR, HISTORY, LIBRARY, REPORT, Task
from sidegan.pipeline.plan_conditional import STUDY, Conditions
from sidegan.pipeline.stages.common import finite, measured, numbers, produce_all, summary, words
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)

_BATCH = 500  # trajectories drawn at once


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train the generator, then measure it, or draw from it what is asked."""
    conditions = Conditions(Task(cfg, store))
    wanted = conditions.asked  # refused before any work
    stamps, makes = [conditions.generator], [partial(_train, conditions, None)]
    if wanted is None:
        singles = conditions.dedicated()
        stamps += [conditions.single(*one) for one in singles]
        makes += [partial(_train, conditions, one) for one in singles]
    produce_all(conditions.task, "training for conditions (%)", stamps, makes)
    _tell(store, conditions, tracker)
    if wanted is None:
        folder = store.produce(conditions.study, partial(_study, conditions))
        for row in read_json(folder / STUDY)["kinds"]:
            log.info("conditions of kind %s: %s", row["kind"], words(row))
            facts = {k: v for k, v in numbers(row).items()}
            tracker.log_metrics({f"conditional/{row['kind']}/{key}": value for key, value in facts.items()})
    else:
        folder = store.produce(conditions.library, partial(_fill, conditions, wanted))
        facts = numbers(read_json(folder / REPORT))
        log.info("library for what is asked: %s", words(facts))
        tracker.log_metrics({f"conditional/asked/{key}": value for key, value in facts.items()})


def _tell(store: Store, conditions: Conditions, tracker: Tracker) -> None:
    history = read_json(store.require(conditions.generator) / HISTORY)
    for key in history[0]:
        known = [(i, row[key]) for i, row in enumerate(history) if row[key] is not None]
        tracker.log_history({f"conditional/{key}": [v for _, v in known]}, [i for i, _ in known])
    log.info("conditional after %d epochs: %s", len(history), words(history[-1]))


def _train(
    conditions: Conditions, single: tuple[str, int] | None, folder: Path, work: Path, report: Report
) -> None:
    from sidegan.conditional.training import train

    task = conditions.task
    settings, only, name = task.cfg.conditional.training, None, "conditional"
    if single is not None:
        kind, number = single
        settings = replace(settings, epochs=task.cfg.conditional.study.epochs)
        only, name = conditions.drawn(kind).row(number), f"conditional {kind} {number}"
    trained = train(
        conditions.space,
        settings,
        work,
        task.number(name),
        only,
        lambda epoch, _: report(epoch + 1, settings.epochs),
    )
    trained.generator.save(folder / GENERATOR)
    write_json(folder / HISTORY, [finite(row) for row in trained.history])


def _load(conditions: Conditions, single: tuple[str, int] | None = None) -> ConditionalGenerator:
    task = conditions.task
    stamp = conditions.generator if single is None else conditions.single(*single)
    return ConditionalGenerator.load(task.store.require(stamp) / GENERATOR, task.constraints)


def _study(conditions: Conditions, folder: Path, work: Path) -> None:
    dedicated = {one: _load(conditions, one) for one in conditions.dedicated()}
    task = conditions.task
    study = Study(_load(conditions), dedicated, task.cfg.conditional.study, task.number)
    tables = study.tables({case: conditions.drawn(case) for case in conditions.space.ranges.cases})
    write_json(folder / STUDY, {name: [finite(row) for row in rows] for name, rows in tables.items()})


def _fill(conditions: Conditions, condition: Condition, folder: Path, work: Path) -> None:
    """Sample, check and keep until the library is full."""
    task, wanted = conditions.task, conditions.task.cfg.conditional
    generator = _load(conditions)
    noise = torch.Generator().manual_seed(task.number("conditional library"))
    kept: list[Tensor] = []
    drawn = count = 0
    own = condition.family(task.trajectory)
    while count < wanted.count and drawn < wanted.draws:
        _, c = generator.sample(min(_BATCH, wanted.draws - drawn), condition, noise)
        kept.append(c[validity(generator, condition, c).valid])
        drawn, count = drawn + len(c), count + len(kept[-1])
    if not count:
        raise InfeasibleError(
            f"none of {drawn} trajectories drawn for {condition.describe()} is valid: "
            "it leaves the arm no room"
        )
    if count < wanted.count:
        log.warning("%d valid trajectories in %d draws, %d were wanted", count, drawn, wanted.count)
    constraints = condition.constraints(task.constraints)
    made = measured(constraints, own, torch.cat(kept)[: wanted.count], "conditional")
    made.save(folder / LIBRARY)
    share = {"drawn": drawn, "valid_share": count / drawn, "condition_asked": condition.describe()}
    write_json(folder / REPORT, share | {k: v for k, v in summary(made).items() if k != "valid"})
