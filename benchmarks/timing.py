"""How a benchmark is timed, and what one row of the table says.

Wall time of one process with a stated number of threads, and CPU time beside it; after one warm-up the
median of runs that take turns with the opponent's, so that a machine that slows down slows both.
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import yaml

# Unit, goal, threads and opponent of every benchmark by its name.
ROWS: dict[str, dict[str, Any]] = yaml.safe_load(Path(__file__).with_name("rows.yaml").read_text("utf-8"))


class Timing(NamedTuple):
    """Wall and CPU time of one run [s]."""

    wall: float
    cpu: float


@dataclass(frozen=True)
class Result:
    """What one benchmark measured.

    Attributes:
        run: of sidegan.
        amount: things done in that run where more is better, else what a second of it costs.
        opponent: what the opponent reaches, in the row's unit.
        also: further numbers in the same unit, or why there are none.
    """

    run: Timing
    amount: float
    opponent: float
    also: dict[str, float | str] = field(default_factory=dict)


def row(name: str, result: Result) -> dict[str, Any]:
    """A row of the table, as it is written to JSON.

    ``ratio`` says how many times better ours is than the opponent, whichever direction is better;
    ``by_cpu`` is ours in CPU time.
    """
    about = dict(ROWS[name])
    more = about.pop("more")
    ours, by_cpu = ((result.amount / x if more else result.amount * x) for x in result.run)

    def times_better(than: float) -> float:
        return ours / than if more else than / ours

    return {
        "name": name,
        "ours": ours,
        "opponent": result.opponent,
        "ratio": times_better(result.opponent),
        "reached": times_better(about["goal"]) >= 1,
        "by_cpu": by_cpu,
        "also": result.also,
        **about,
    }


def timed(work: Callable[[], object]) -> Timing:
    """One run."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return Timing(time.perf_counter() - wall, time.process_time() - cpu)


def medians(repeats: int, *works: Callable[[], object]) -> list[Timing]:
    """Median times of each piece of work, after one warm-up each; they take turns."""
    for work in works:
        work()
    rounds = [[timed(work) for work in works] for _ in range(repeats)]
    return [Timing(*map(statistics.median, zip(*runs))) for runs in zip(*rounds)]
