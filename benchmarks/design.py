"""The command ``python -m benchmarks.design [--quick]``: picks by optimal design, how fast and how good."""

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import torch
from torch import Tensor

from benchmarks.limits import bandwidth
from benchmarks.setting import Setting
from benchmarks.timing import Row, Timing, cost, threads, timed
from sidegan.design.criteria import DETERMINANT, criteria_of, variance
from sidegan.design.greedy import greedy
from sidegan.design.information import Information, information_of
from sidegan.design.optimal import a_optimal, ceiling, d_optimal, exchange

_LIBRARY, _PICKS = 100_000, 35
_SAMPLES = 40  # states per trajectory
_PLAIN = 2_000  # trajectories from which the cost of evaluating all of them is taken


class Picked(NamedTuple):
    """What one method picked, and in which time."""

    method: str
    timing: Timing
    chosen: Tensor


def design(setting: Setting) -> Row:
    """Seconds for the D-optimal pick of 35 of 100,000, on one thread, beside plain greedy."""
    with threads(1):
        information, diagonals = _library(setting)
        ours, *others = _picks(information, diagonals)
        plain = _plain(information)
    matrices = information.packed.numel() * information.packed.element_size()
    return cost(
        "design",
        "s",
        1.0,
        ours.timing,
        plain,
        _PICKS * matrices / bandwidth(1),
        30.0,
        against=f"plain greedy in batches of torch, {_PLAIN:,} evaluations timed",
        limit_is="every matrix read once per pick, at the measured bandwidth of a copy",
        threads=1,
        also={other.method: other.timing.wall for other in others},
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.design", description="Measure picks by optimal design."
    )
    parser.add_argument("--quick", action="store_true", help="a tenth of the work: does everything run?")
    setting = Setting(parser.parse_args(arguments).quick)
    with threads(1):
        information, diagonals = _library(setting)
        picked = _picks(information, diagonals)
    show(information, picked)
    return 0


def show(information: Information, picked: Sequence[Picked]) -> None:
    """Print what was picked as one table."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{_PICKS} of {len(information):,} trajectories, one thread", title_justify="left")
    columns = (
        "method",
        "wall s",
        "CPU s",
        "log det",
        "at most",
        "trace of inverse",
        "covariance norm",
        "condition",
    )
    for column in columns:
        table.add_column(column, justify="left" if column == "method" else "right")
    for method, timing, chosen in picked:
        found, most = criteria_of(information.stacked(chosen)), ceiling(information, chosen)[1]
        numbers = (found.trace_inverse, found.covariance_norm, found.condition)
        hundredths = (timing.wall, timing.cpu, found.log_det, most)
        table.add_row(method, *(f"{x:.2f}" for x in hundredths), *(f"{x:.4g}" for x in numbers))
    console = Console()
    (console if console.is_terminal else Console(width=120)).print(table)


def _library(setting: Setting) -> tuple[Information, Tensor]:
    """Information of random trajectories, and the diagonals that the paper's score takes."""
    c = setting.start(setting.size(_LIBRARY))
    information = information_of(setting.body, setting.trajectory, c, _SAMPLES)
    columns = torch.linalg.inv(setting.body.base.subspace)  # xᵀ (Cᵀ G C) x is G's diagonal element
    return information, information.products(torch.einsum("ip,jp->pij", columns, columns))


def _picks(information: Information, diagonals: Tensor) -> list[Picked]:
    chance = torch.randperm(len(information), generator=torch.Generator().manual_seed(0))[:_PICKS]
    d = _picked("D-optimal", partial(d_optimal, information, _PICKS))
    a = _picked("A-optimal", partial(a_optimal, information, _PICKS))
    return [
        d,
        _picked("exchange after it", partial(exchange, information, d.chosen, DETERMINANT)),
        a,
        _picked("exchange after A", partial(exchange, information, a.chosen, variance())),
        _picked("exchange from chance", partial(exchange, information, chance, DETERMINANT)),
        _picked("the paper's score", partial(greedy, diagonals, _PICKS)),
        _picked("chance", lambda: chance),
    ]


def _picked(method: str, work: Callable[[], Tensor]) -> Picked:
    found: list[Tensor] = []
    timing = timed(lambda: found.append(work()))
    return Picked(method, timing, found[0])


def _plain(information: Information) -> float:
    """Seconds that plain greedy would take: every candidate evaluated for every pick."""
    few = slice(0, min(_PLAIN, len(information)))
    known = information.mean
    once = timed(lambda: DETERMINANT.value(known + information.matrices(few)))
    return once.wall * _PICKS * len(information) / len(information.packed[few])


if __name__ == "__main__":
    sys.exit(main())
