"""What several stages do: measure a library, make artifacts side by side, sum up for people."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from sidegan.base.parallel import Report, run_jobs
from sidegan.library import Library
from sidegan.library.measure import RATE, measured, summary  # noqa: F401 - for the stages
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.plan import LIBRARY, Task
from sidegan.pipeline.stamp import Stamp

Make = Callable[..., None]


def load(task: Task, stamp: Stamp) -> Library:
    """The library in an artifact that must be there."""
    return Library.load(task.store.require(stamp) / LIBRARY, task.arm)


def training_seeds(task: Task) -> Library:
    """The seeds that surrogates and generators learn from."""
    seeds = load(task, task.seeds)
    return seeds if task.cfg.subset is None else seeds.take(range(min(task.cfg.subset, len(seeds))))


def produce_all(task: Task, what: str, stamps: Sequence[Stamp], makes: Sequence[Make]) -> None:
    """Produce artifacts side by side, each in a process of its own; ``make(folder, work, report)``."""
    missing = [(stamp, make) for stamp, make in zip(stamps, makes) if task.store.find(stamp) is None]
    if missing:
        run_jobs(what, [partial(_produce, task.store, *one) for one in missing], task.cfg.parallel.workers)


def _produce(store: Store, stamp: Stamp, make: Make, report: Report) -> None:
    store.produce(stamp, partial(make, report=report))


def numbers(report: Mapping[str, object]) -> dict[str, float]:
    """The numeric entries of a report."""
    return {key: float(value) for key, value in report.items() if isinstance(value, (int, float))}


def words(report: dict[str, Any]) -> str:
    """A report as one line for people."""
    return ", ".join(
        f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
        for key, value in report.items()
    )


def finite(row: dict[str, Any]) -> dict[str, Any]:
    """The row with None in place of what is not a finite number, as JSON wants it."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
