"""How a benchmark is timed, and what one row of the table says.

Wall time of one process with a stated number of threads, and CPU time beside it; after one warm-up the
median of runs that take turns with the opponent's, so that a machine that slows down slows both.
"""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import torch


class Timing(NamedTuple):
    """Wall and CPU time of one run [s]."""

    wall: float
    cpu: float


@dataclass(frozen=True)
class Row:
    """One measured quantity.

    Attributes:
        name: of the benchmark.
        ours: what sidegan reaches, in wall time unless the unit says CPU.
        unit: of all numbers.
        opponent: what the opponent reaches; None where none could be measured.
        against: who the opponent is.
        ratio: how many times better ours is, whichever direction is better.
        limit: what the hardware would allow; None where nothing was counted.
        limit_is: what was measured or counted for it.
        share: how far from it: 1 is at the limit.
        goal: what it must reach.
        reached: whether it does.
        threads: that ours ran on.
        by_cpu: ours in CPU time: a rate per CPU second, or a cost in it.
        also: further opponents in the same unit, or why they were skipped.
    """

    name: str
    ours: float
    unit: str
    opponent: float | None
    against: str
    ratio: float | None
    limit: float | None
    limit_is: str
    share: float | None
    goal: float
    reached: bool
    threads: int
    by_cpu: float
    also: dict[str, float | str] = field(default_factory=dict)


def rate(
    name: str,
    unit: str,
    count: float,
    run: Timing,
    opponent: float | None,
    limit: float | None,
    goal: float,
    **rest: Any,
) -> Row:
    """A row in which more is better: so many things in one run of ours."""
    ours = count / run.wall
    return Row(
        name,
        ours,
        unit,
        opponent,
        ratio=opponent and ours / opponent,
        limit=limit,
        share=limit and ours / limit,
        goal=goal,
        reached=ours >= goal,
        by_cpu=count / run.cpu,
        **rest,
    )


def cost(
    name: str,
    unit: str,
    scale: float,
    run: Timing,
    opponent: float | None,
    limit: float | None,
    goal: float,
    **rest: Any,
) -> Row:
    """A row in which less is better: ``scale`` times the time of one run of ours."""
    ours = scale * run.wall
    return Row(
        name,
        ours,
        unit,
        opponent,
        ratio=opponent and opponent / ours,
        limit=limit,
        share=limit and limit / ours,
        goal=goal,
        reached=ours <= goal,
        by_cpu=scale * run.cpu,
        **rest,
    )


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Torch on so many threads."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def timed(work: Callable[[], object]) -> Timing:
    """One run."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return Timing(time.perf_counter() - wall, time.process_time() - cpu)


def medians(repeats: int, *works: Callable[[], object]) -> list[Timing]:
    """Median times of each piece of work, after one warm-up each; they take turns."""
    runs: list[list[Timing]] = [[] for _ in works]
    for index in range(repeats + 1):
        for work, found in zip(works, runs):
            timing = timed(work)
            if index:
                found.append(timing)
    return [Timing(*(statistics.median(part) for part in zip(*found))) for found in runs]
