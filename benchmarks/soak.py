"""The command ``python -m benchmarks.soak``: the library's work over and over in one process.

Resident memory is looked at every few seconds, always between two rounds of the same work, and must not grow:
the exit code is 1 when it does. Samples and picture go to docs/growth.
"""

import argparse
import gc
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import torch
from scipy import stats

from benchmarks import curves
from benchmarks.networks import train, variants
from benchmarks.setting import Setting
from sidegan.base.storage import write_bytes
from sidegan.report.canvas import blank, save, tidy
from sidegan.report.style import PALETTE

FOLDER = Path(__file__).parent.parent / "docs" / "growth"

_EVERY = 5.0  # [s] between samples
_WARM_UP = 0.2  # share of the run in which caches may fill
_MEANS = 16  # consecutive means that the slope is fitted to
_ALLOWED = 5.0  # [MB/h] that nobody would notice in a day
_SEEDS, _DRAWN, _RECORDINGS = 10, 1000, 4  # of one round


def one_round() -> None:
    """Seeds, the training of a generator, a library from noise to the selection, an identification."""
    curves.seeds(_SEEDS)
    brief = replace(variants()["vanilla"], epochs=2, steps=5, batch=50, width=64)
    train(Setting(quick=True), "soak", brief, 2 * _SEEDS)
    curves.library(_DRAWN)
    curves.rls(_RECORDINGS)


def soak(work: Callable[[], object], seconds: float, every: float = _EVERY) -> pd.DataFrame:
    """Samples of this process [every so many s] while it does its work for so long.

    Columns: seconds, resident_mb, and the numbers of rounds, objects, files and threads.
    """
    process, began = psutil.Process(), time.monotonic()
    samples: list[tuple[float, ...]] = []

    def look(rounds: int) -> None:
        gc.collect()  # else garbage that waits for its collector would look like growth
        memory, objects = process.memory_info().rss / 2**20, len(gc.get_objects())
        counts = (rounds, objects, process.num_fds(), process.num_threads())
        samples.append((time.monotonic() - began, memory, *counts))

    rounds = 0
    while time.monotonic() - began < seconds or len(samples) < 2:
        if not samples or time.monotonic() - began - samples[-1][0] >= every:
            look(rounds)
        work()
        rounds += 1
    look(rounds)
    return pd.DataFrame(samples, columns=["seconds", "resident_mb", "rounds", "objects", "files", "threads"])


def slope_of(samples: pd.DataFrame) -> tuple[float, float]:
    """Growth of memory after the warm-up [MB/h], and half the width of its 95 % interval.

    Neighbouring samples are alike, which would make a fit to all of them too sure of itself: it is taken over
    means of consecutive samples instead.
    """
    late = _warm(samples)[["seconds", "resident_mb"]].to_numpy()
    means = np.array([part.mean(0) for part in np.array_split(late, min(_MEANS, len(late)))])
    if len(means) < 3:  # a line through two points has no error
        return 0.0, math.inf
    fit = stats.linregress(means[:, 0] / 3600, means[:, 1])
    return float(fit.slope), float(stats.t.ppf(0.975, len(means) - 2) * fit.stderr)


def grows(slope: float, margin: float) -> bool:
    """Whether memory surely grows by more than is allowed [MB/h]."""
    return slope - margin > _ALLOWED


def outcome(samples: pd.DataFrame) -> str:
    """The outcome in a sentence or two."""
    slope, margin = slope_of(samples)
    first, last = _warm(samples).iloc[0], samples.iloc[-1]
    words = "GROWS" if grows(slope, margin) else "does not grow"
    units = {"resident_mb": "MB", "objects": "objects", "files": "open files", "threads": "threads"}
    changes = [f"{first[key]:.0f} → {last[key]:.0f} {unit}" for key, unit in units.items()]
    return (
        f"{last.rounds:.0f} rounds in {last.seconds / 60:.1f} min, {len(samples)} samples: memory {words}. "
        f"After a warm-up of {first.seconds / 60:.1f} min: {slope:+.1f} ± {margin:.1f} MB/h (95 %), "
        + ", ".join(changes)
    )


def draw(samples: pd.DataFrame, path: Path) -> None:
    """A picture of the memory over time, with the line of its slope."""
    slope, margin = slope_of(samples)
    minutes, late = samples.seconds / 60, _warm(samples)
    line = late.resident_mb.mean() + slope * (late.seconds - late.seconds.mean()) / 3600
    figure = blank(5.5, 3.7)
    axes = figure.subplots()
    axes.axvspan(0, late.seconds.iloc[0] / 60, color="#7f7f7f", alpha=0.12, linewidth=0, label="warm-up")
    axes.plot(minutes, samples.resident_mb, color=PALETTE[0], linewidth=1, label="measured")
    axes.plot(late.seconds / 60, line, color=PALETTE[1], label=f"{slope:+.1f} ± {margin:.1f} MB/h")
    axes.set(xlabel="time [min]", ylabel="resident memory [MB]", xlim=(0, minutes.max()))
    axes.set_ylim(0, 1.15 * samples.resident_mb.max())
    axes.legend(fontsize=8, frameon=False)
    tidy(axes)
    save(figure, path)


def _warm(samples: pd.DataFrame) -> pd.DataFrame:
    """The samples after the warm-up."""
    return samples[samples.seconds >= _WARM_UP * samples.seconds.iloc[-1]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 1 when memory grows."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description="Does memory stay flat?")
    parser.add_argument("--minutes", type=float, default=30.0, help="how long (default 30)")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where samples and picture go")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    samples = soak(one_round, 60 * options.minutes)
    write_bytes(options.folder / "soak.csv", samples.to_csv(index=False, float_format="%.1f").encode())
    draw(samples, options.folder / "soak")
    print(outcome(samples))
    return int(grows(*slope_of(samples)))


if __name__ == "__main__":
    sys.exit(main())
