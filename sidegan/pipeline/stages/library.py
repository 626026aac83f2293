"""Stage library: draw from each generator and keep what is valid."""

import logging
from functools import partial
from pathlib import Path

import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import read_json, write_json
from sidegan.design.polish import Polish
from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError
from sidegan.library import Library
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import GENERATOR, LIBRARY, REPORT, Task
from sidegan.pipeline.stages.common import load, measured, numbers, produce_all, summary, words
from sidegan.pipeline.tracking import Tracker
from sidegan.validity import check

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Fill a library from every generator."""
    task = Task(cfg, store)
    wanted = [(name, training) for name in cfg.gan for training in cfg.trainings]
    stamps = [task.library(*one) for one in wanted]
    produce_all(task, "libraries (%)", stamps, [partial(_make, task, *one) for one in wanted])
    for one, stamp in zip(wanted, stamps):
        report, title = read_json(store.require(stamp) / REPORT), task.named(*one)
        log.info("library of %s: %s", title, words(report))
        tracker.log_metrics({f"library/{title}/{key}": value for key, value in numbers(report).items()})


def _make(task: Task, name: str, training: int, folder: Path, work: Path, report: Report) -> None:
    """Sample, check and keep until the library is full."""
    from sidegan.gan import TrajectoryGenerator

    wanted = task.cfg.library
    path = task.store.require(task.gan(name, task.cfg.gan[name], training)) / GENERATOR
    generator = TrajectoryGenerator.load(path, task.arm)
    noise = torch.Generator().manual_seed(task.number(f"library {name}", training))
    polish = Polish(wanted.polish, wanted.reserve) if wanted.polish else None
    problem = Problem(task.constraints, task.trajectory)
    kept: list[Tensor] = []
    drawn = count = 0
    while count < wanted.count and drawn < wanted.draws:
        c = generator.sample(wanted.batch, noise)
        c = c if polish is None else polish.improve(problem, c)
        verdict = check(task.constraints, task.trajectory, c)
        kept.append(c[verdict.valid])
        drawn, count = drawn + len(c), count + len(kept[-1])
        report(max(min(count, wanted.count), drawn * wanted.count // wanted.draws), wanted.count)
    if count < wanted.count:
        log.warning(
            "%s gave %d valid trajectories in %d draws, %d were wanted", name, count, drawn, wanted.count
        )
    if not count:
        worst = "; ".join(f"{n} violate {fault}" for fault, n in verdict.faults().most_common(3))
        raise InfeasibleError(
            f"none of {drawn} trajectories drawn from {name} is valid; of the last {len(c)}, {worst}"
        )
    made = measured(task.constraints, task.trajectory, torch.cat(kept)[: wanted.count], name)
    made.save(folder / LIBRARY)
    share = {"drawn": drawn, "valid_share": count / drawn}
    known = {k: v for k, v in summary(made).items() if k != "valid"}
    if task.cfg.gan[name].seeded:
        known |= _union(task, made, noise)
    write_json(folder / REPORT, share | known)


def _union(task: Task, made: Library, generator: torch.Generator) -> dict[str, float]:
    """Diversity of the library and the seeds put together."""
    both = load(task, task.seeds).merge(made)
    shuffled = summary(both.take(torch.randperm(len(both), generator=generator)))
    return {f"union_{key}": shuffled[key] for key in ("distance", "distance_diagonal", "rank")}
