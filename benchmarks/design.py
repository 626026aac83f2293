"""The command ``python -m benchmarks.design [--quick]``: picks by optimal design, how fast and how good."""

import argparse
import sys
from collections.abc import Sequence

import pandas as pd
import torch
from torch import Tensor

from benchmarks.setting import Setting
from benchmarks.timing import Result, Timing, threads, timed
from sidegan.design.criteria import DETERMINANT, criteria_of, variance
from sidegan.design.greedy import greedy
from sidegan.design.information import Information, information_of
from sidegan.design.optimal import a_optimal, ceiling, d_optimal, exchange

_LIBRARY, _PICKS = 100_000, 35
_SAMPLES = 40  # states per trajectory
_PLAIN = 2_000  # trajectories from which the cost of evaluating all of them is taken

Pick = tuple[Tensor, Timing]


def design(setting: Setting) -> Result:
    """Seconds for the D-optimal pick of 35 of 100,000, on one thread, beside plain greedy."""
    information, diagonals = library(setting)
    picked = {method: timing for method, (_, timing) in picks(information, diagonals).items()}
    return Result(
        picked.pop("D-optimal"),
        1.0,
        _plain(information),
        also={method: timing.wall for method, timing in picked.items()},
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.design", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a tenth of the work: does everything run?")
    setting = Setting(parser.parse_args(arguments).quick)
    with threads(1):
        information, diagonals = library(setting)
        picked = picks(information, diagonals)
    print(f"{_PICKS} of {len(information):,} trajectories, one thread")
    print(table(information, picked).to_string(float_format="{:.6g}".format))
    return 0


def table(information: Information, picked: dict[str, Pick]) -> pd.DataFrame:
    """What was picked, by method: times [s] and criteria."""
    rows = {}
    for method, (chosen, timing) in picked.items():
        most, criteria = ceiling(information, chosen)[1], criteria_of(information.stacked(chosen))
        rows[method] = {"wall s": timing.wall, "CPU s": timing.cpu, "at most": most, **criteria._asdict()}
    return pd.DataFrame.from_dict(rows, orient="index")


def library(setting: Setting) -> tuple[Information, Tensor]:
    """Information of random trajectories, and the diagonals that the paper's score takes, (N, p)."""
    c = setting.start(setting.size(_LIBRARY))
    information = information_of(setting.problem.body, setting.problem.trajectory, c, _SAMPLES)
    columns = torch.linalg.inv(setting.problem.body.base.subspace)  # xᵀ (Cᵀ G C) x is G's diagonal element
    return information, information.products(torch.einsum("ip,jp->pij", columns, columns))


def picks(information: Information, diagonals: Tensor) -> dict[str, Pick]:
    """Trajectories that each method picks, and how long it takes."""
    chance = torch.randperm(len(information), generator=torch.Generator().manual_seed(0))[:_PICKS]
    picked: dict[str, Pick] = {}
    methods = {
        "D-optimal": lambda: d_optimal(information, _PICKS),
        "exchange after it": lambda: exchange(information, picked["D-optimal"][0], DETERMINANT),
        "A-optimal": lambda: a_optimal(information, _PICKS),
        "exchange after A": lambda: exchange(information, picked["A-optimal"][0], variance()),
        "exchange from chance": lambda: exchange(information, chance, DETERMINANT),
        "the paper's score": lambda: greedy(diagonals, _PICKS),
        "chance": lambda: chance,
    }
    for method, pick in methods.items():
        chosen: list[Tensor] = []
        timing = timed(lambda pick=pick, chosen=chosen: chosen.append(pick()))  # type: ignore[misc]
        picked[method] = chosen[0], timing
    return picked


def _plain(information: Information) -> float:
    """Seconds that plain greedy would take: every candidate evaluated for every pick."""
    few = slice(0, min(_PLAIN, len(information)))
    mean = information.mean
    once = timed(lambda: DETERMINANT.value(mean + information.matrices(few)))
    return once.wall * _PICKS * len(information) / len(information.packed[few])


if __name__ == "__main__":
    sys.exit(main())
