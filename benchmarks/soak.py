"""The command ``python -m benchmarks.soak``: the library's work over and over in one process.

Resident memory is looked at every few seconds, always between two rounds of the same work, and must not grow:
the exit code is 1 when it does. Samples and picture go to docs/growth.
"""

import argparse
import csv
import gc
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import torch

from benchmarks.pictures import picture
from benchmarks.setting import Setting
from benchmarks.soak_work import Work

FOLDER = Path(__file__).parent.parent / "docs" / "growth"

_EVERY = 5.0  # [s] between samples
_WARM_UP = 0.2  # share of the run in which caches may fill
_MEANS = 16  # consecutive means that the slope is fitted to
_ALLOWED = 5.0  # [MB/h] that nobody would notice in a day
_MB = 2**20


class Sample(NamedTuple):
    """The process at one moment: time [s], memory [MB], rounds, Python objects, open files, threads."""

    seconds: float
    resident_mb: float
    rounds: int
    objects: int
    files: int
    threads: int


class Slope(NamedTuple):
    """Growth of memory [MB/h], and half the width of its 95 % interval."""

    value: float
    margin: float

    @property
    def grows(self) -> bool:
        """Whether memory surely grows by more than is allowed."""
        return self.value - self.margin > _ALLOWED


def soak(work: Callable[[int], None], seconds: float, every: float = _EVERY) -> list[Sample]:
    """Samples of this process [every so many s] while it does its work for so long."""
    began = time.monotonic()
    samples: list[Sample] = []
    rounds = 0
    while (now := time.monotonic() - began) < seconds or len(samples) < 2:
        if not samples or now - samples[-1].seconds >= every:
            samples.append(_look(now, rounds))
        work(rounds)
        rounds += 1
    return [*samples, _look(time.monotonic() - began, rounds)]


def _look(seconds: float, rounds: int) -> Sample:
    gc.collect()  # else garbage that waits for its collector would look like growth
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    resident = pages * os.sysconf("SC_PAGE_SIZE") / _MB
    files, threads = (len(list(Path("/proc/self", name).iterdir())) for name in ("fd", "task"))
    return Sample(seconds, resident, rounds, len(gc.get_objects()), files, threads)


def slope_of(samples: Sequence[Sample]) -> Slope:
    """Growth of memory after the warm-up.

    Neighbouring samples are alike, which would make a fit to all of them too sure of itself: it is taken over
    means of consecutive samples instead.
    """
    from scipy import stats

    late = warm(samples)
    means = np.array([np.mean(part, axis=0) for part in np.array_split(late, min(_MEANS, len(late)))])
    if len(means) < 3:  # a line through two points has no error
        return Slope(0.0, math.inf)
    fit = stats.linregress(means[:, 0] / 3600, means[:, 1])
    return Slope(float(fit.slope), float(stats.t.ppf(0.975, len(means) - 2) * fit.stderr))


def warm(samples: Sequence[Sample]) -> list[Sample]:
    """The samples after the warm-up."""
    return [one for one in samples if one.seconds >= _WARM_UP * samples[-1].seconds]


def told(samples: Sequence[Sample], slope: Slope) -> str:
    """The outcome in a sentence or two."""
    first, last = warm(samples)[0], samples[-1]
    words = "GROWS" if slope.grows else "does not grow"
    return (
        f"{last.rounds} rounds in {last.seconds / 60:.1f} min, {len(samples)} samples: memory {words}. After "
        f"a warm-up of {first.seconds / 60:.1f} min: {slope.value:+.1f} ± {slope.margin:.1f} MB/h (95 %), "
        f"{first.resident_mb:.0f} → {last.resident_mb:.0f} MB, {first.objects} → {last.objects} objects, "
        f"{first.files} → {last.files} open files, {first.threads} → {last.threads} threads"
    )


def draw(samples: Sequence[Sample], slope: Slope, path: Path) -> None:
    """A picture of the memory over time, with the line whose slope is told."""
    minutes = np.array([one.seconds / 60 for one in samples])
    memory = np.array([one.resident_mb for one in samples])
    late = minutes >= _WARM_UP * minutes[-1]
    line = memory[late].mean() + slope.value * (minutes - minutes[late].mean()) / 60
    with picture(path, "time [min]", "resident memory [MB]") as (axes,):
        axes.axvspan(0, minutes[late][0], color="#7f7f7f", alpha=0.12, linewidth=0, label="warm-up")
        axes.plot(minutes, memory, color="#1f77b4", linewidth=1, label="measured")
        trend = f"{slope.value:+.1f} ± {slope.margin:.1f} MB/h"
        axes.plot(minutes[late], line[late], color="#d95f02", linewidth=1.5, label=trend)
        axes.set_xlim(0, minutes[-1])
        axes.set_ylim(0, 1.15 * memory.max())


def read(path: Path) -> list[Sample]:
    """The samples of a run's table."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    kinds = Sample.__annotations__
    return [Sample(**{name: kinds[name](value) for name, value in row.items()}) for row in rows]


def _write(samples: Sequence[Sample], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(Sample._fields)
        table.writerows(
            [f"{value:.1f}" if isinstance(value, float) else value for value in one] for one in samples
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 1 when memory grows."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description="Does memory stay flat?")
    parser.add_argument("--minutes", type=float, default=30.0, help="how long (default 30)")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where samples and picture go")
    chosen = parser.parse_args(arguments)
    torch.set_num_threads(1)
    with TemporaryDirectory() as folder:
        samples = soak(Work(Setting(), Path(folder)).round, 60 * chosen.minutes)
    _write(samples, chosen.folder / "soak.csv")
    slope = slope_of(samples)
    draw(samples, slope, chosen.folder / "soak.png")
    print(told(samples, slope))
    return int(slope.grows)


if __name__ == "__main__":
    sys.exit(main())
