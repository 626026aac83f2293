"""How a benchmark is timed: warm-up, then the median CPU time of runs that take turns with the opponent's.

CPU time and one thread: what else runs on the machine then changes the numbers by little.
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One measured quantity.

    Attributes:
        name: of the benchmark.
        ours: what sidegan reaches.
        unit: of both numbers.
        opponent: what the opponent reaches.
        against: who the opponent is.
        ratio: how many times better ours is, whichever direction is better.
        limit: ratio that must not be undercut; None where there is none.
    """

    name: str
    ours: float
    unit: str
    opponent: float
    against: str
    ratio: float
    limit: float | None = None


def rate_row(name: str, unit: str, ours: float, opponent: float, against: str) -> Row:
    """A row in which more is better."""
    return Row(name, ours, unit, opponent, against, ours / opponent)


def cost_row(name: str, unit: str, ours: float, opponent: float, against: str) -> Row:
    """A row in which less is better."""
    return Row(name, ours, unit, opponent, against, opponent / ours)


def medians(repeats: int, *works: Callable[[], object]) -> list[float]:
    """Median CPU time [s] of each piece of work, after one warm-up each.

    They take turns, so that a machine that slows down slows all of them.
    """
    seconds: list[list[float]] = [[] for _ in works]
    for index in range(repeats + 1):
        for work, found in zip(works, seconds):
            began = time.process_time()
            work()
            if index:
                found.append(time.process_time() - began)
    return [statistics.median(found) for found in seconds]
