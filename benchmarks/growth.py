"""The command ``python -m benchmarks.growth``: how costs grow, as CSV and pictures in docs/growth.

Every point is measured in a process of its own on one thread and kept in a file of its own: a run that
was stopped goes on where it was, and ``--fresh`` measures anew.
"""

import argparse
import csv
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

FOLDER = Path(__file__).parent.parent / "docs" / "growth"


@dataclass(frozen=True)
class Curve:
    """One curve: what is varied, where it is measured, and which of its numbers the picture shows."""

    label: str
    points: tuple[int, ...]
    small: tuple[int, ...]
    shown: tuple[str, ...]
    unit: str


_PER_TRAJECTORY = ("gram_ms", "gradient_ms", "validity_ms")
_STEPS = ("generation_s", "filter_s", "excitation_s", "write_s", "selection_s", "read_s")
CURVES = {
    "joints": Curve("joints", tuple(range(2, 15)), (2, 9), _PER_TRAJECTORY, "CPU ms per trajectory"),
    "samples": Curve(
        "samples", (20, 40, 80, 160, 320, 640, 1280), (20, 40), _PER_TRAJECTORY, "CPU ms per trajectory"
    ),
    "harmonics": Curve(
        "harmonics", (1, 2, 3, 6, 12, 24, 48), (1, 6), _PER_TRAJECTORY, "CPU ms per trajectory"
    ),
    "seeds": Curve(
        "seeds in a batch", (1, 2, 5, 10, 20, 50, 100, 200), (1, 3), ("cpu_s_per_seed",), "CPU s per seed"
    ),
    "library": Curve("trajectories", (1_000, 10_000, 100_000, 1_000_000), (100, 1_000), _STEPS, "s"),
    "rls": Curve(
        "trajectories of 1600 samples", (10, 30, 100, 300, 1000, 3000, 6000), (2, 5), ("wall_s", "cpu_s"), "s"
    ),
    "long": Curve(
        "length in periods of 16 s",
        (1, 2, 4, 8, 16, 35),
        (1, 2),
        ("one_long_cpu_s", "many_short_cpu_s", "without_gradients_s"),
        "CPU s",
    ),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.growth", description="Measure how costs grow."
    )
    parser.add_argument("--curves", nargs="+", choices=CURVES, default=list(CURVES), metavar="NAME")
    parser.add_argument("--small", action="store_true", help="two small points of each: does everything run?")
    parser.add_argument("--fresh", action="store_true", help="measure again what is there")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where points, tables and pictures go")
    chosen = parser.parse_args(arguments)
    for name in chosen.curves:
        curve = CURVES[name]
        points = curve.small if chosen.small else curve.points
        for at in points:
            _measure(name, at, chosen.folder, chosen.fresh)
        rows = _rows(name, chosen.folder)
        _write(rows, chosen.folder / f"{name}.csv")
        _draw(curve, rows, chosen.folder / f"{name}.png")
    return 0


def _measure(name: str, at: int, folder: Path, fresh: bool) -> None:
    """Leave a point's file, unless it is there."""
    path = folder / "points" / f"{name}-{at}.json"
    if path.exists() and not fresh:
        return
    sys.stderr.write(f"{name} at {at} …\n")
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = pool.submit(_point, name, at).result()
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".tmp")
    partial.write_text(json.dumps({"at": at, **found}) + "\n", encoding="utf-8")
    partial.replace(path)


def _point(name: str, at: int) -> dict[str, float]:
    import torch

    from benchmarks import curves

    torch.set_num_threads(1)
    curves.warm_up()
    found: dict[str, float] = getattr(curves, name)(at)
    return found


def _rows(name: str, folder: Path) -> list[dict[str, float]]:
    """Every point measured so far, in order."""
    files = (folder / "points").glob(f"{name}-*.json")
    return sorted((json.loads(file.read_text(encoding="utf-8")) for file in files), key=lambda row: row["at"])


def _write(rows: Sequence[dict[str, float]], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        for row in rows:
            table.writerow({key: f"{value:.5g}" for key, value in row.items()})


def _draw(curve: Curve, rows: Sequence[dict[str, float]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.5, 3.6), layout="constrained")
    axes = figure.subplots()
    for name in curve.shown:
        known = [(row["at"], row[name]) for row in rows if row[name] > 0]
        if known:
            axes.loglog(
                *zip(*known), marker="o", markersize=3, label=name.rsplit("_", 1)[0].replace("_", " ")
            )
    axes.set_xlabel(curve.label)
    axes.set_ylabel(curve.unit)
    axes.grid(True, which="both", alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(main())
