"""What several stages do: measure a library, make artifacts side by side, sum up for people."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from torch import Tensor

from sidegan.base.parallel import Report, run_jobs
from sidegan.design.excitation import excite
from sidegan.library import Library
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.plan import LIBRARY, Task
from sidegan.pipeline.stamp import Stamp
from sidegan.validity import Constraints, check

RATE = 12.5  # [Hz] at which stored excitation is taken: finer than any optimiser's samples
_BATCH = 250

Make = Callable[..., None]


def measured(constraints: Constraints, trajectory: Trajectory, c: Tensor, source: str) -> Library:
    """A library of coefficients (N, J, H, 2) with everything measured about them."""
    parts = []
    for batch in c.split(_BATCH):
        validity = check(constraints, trajectory, batch)
        excitation = excite(constraints.body, trajectory, batch, round(RATE * trajectory.period))
        parts.append(
            Library(
                coefficients=batch,
                valid=validity.valid,
                margins=validity.margins,
                fitness=excitation.eigenvalue_fitness,
                diagonal_fitness=excitation.diagonal_fitness,
                spectrum=excitation.spectrum,
                diagonal=excitation.diagonal,
                source=[source] * len(batch),
                robot=constraints.arm.name,
                digest=constraints.arm.digest,
                period=trajectory.period,
                home=tuple(trajectory.home or ()),
            )
        )
    return parts[0].merge(*parts[1:])


def summary(library: Library) -> dict[str, float]:
    """Validity, fitness and diversity of a library."""
    from sidegan.design.excitation import Excitation
    from sidegan.gan.metrics import diversity

    return {
        "count": len(library),
        "valid": float(library.valid.double().mean()),
        "condition": float(library.fitness.median()),
        "diagonal_ratio": float(library.diagonal_fitness.median()),
        **diversity(library.coefficients, Excitation(library.spectrum, library.diagonal)),
    }


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
