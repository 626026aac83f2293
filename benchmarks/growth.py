"""The command ``python -m benchmarks.growth``: how costs grow, as tables and pictures in docs/growth.

Points are measured in a process apart on one thread, in CPU time, since a machine is seldom idle; in one each
where memory is measured too. Points take turns and are repeated: a machine that slows down slows all of them.
Each finished measurement is a row of the curve's table: a run that was stopped goes on where it was.
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from benchmarks import curves
from benchmarks.growth_page import draw, write_page
from sidegan.base.storage import write_bytes

Curve = dict[str, Any]  # an entry of growth.yaml

FOLDER = Path(__file__).parent.parent / "docs" / "growth"
CURVES: dict[str, Curve] = yaml.safe_load(Path(__file__).with_name("growth.yaml").read_text("utf-8"))

_CONTEXT = get_context("forkserver")
_CONTEXT.set_forkserver_preload(["benchmarks.curves"])  # imported once, and not for each point


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.growth", description="Measure how costs grow."
    )
    parser.add_argument("--curves", nargs="+", choices=CURVES, default=list(CURVES), metavar="NAME")
    parser.add_argument("--repeats", type=int, default=3, help="of every point that is not long (default 3)")
    parser.add_argument("--small", action="store_true", help="two small points of each: does everything run?")
    parser.add_argument("--fresh", action="store_true", help="measure again what is there")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where tables and pictures go")
    options = parser.parse_args(arguments)
    for name in options.curves:
        path = options.folder / f"{name}.csv"
        if options.fresh:
            path.unlink(missing_ok=True)
        each = 1 if CURVES[name].get("memory") else None
        with ProcessPoolExecutor(1, _CONTEXT, curves.warm_up, max_tasks_per_child=each) as pool:
            for at, repeat in turns(CURVES[name], options.small, options.repeats):
                _measure(pool, name, at, repeat, path)
        draw(CURVES[name], pd.read_csv(path), path.with_suffix(""))
    write_page(CURVES, options.folder)
    return 0


def turns(curve: Curve, small: bool, repeats: int) -> list[tuple[int, int]]:
    """Points and the numbers of their repeats, in the order to measure them: they take turns."""
    points = curve["small" if small else "points"]
    return [(at, k) for k in range(repeats) for at in points if k == 0 or at not in curve.get("once", [])]


def _measure(pool: ProcessPoolExecutor, name: str, at: int, repeat: int, path: Path) -> None:
    """Leave a measurement's row in the table, unless it is there."""
    rows = pd.read_csv(path) if path.exists() else pd.DataFrame(columns=["at", "repeat"])
    if ((rows["at"] == at) & (rows["repeat"] == repeat)).any():
        return
    sys.stderr.write(f"{name} at {at}, {repeat + 1} …\n")
    row = {"at": at, "repeat": repeat, **pool.submit(getattr(curves, name), at).result()}
    rows = pd.DataFrame([*rows.to_dict("records"), row]).sort_values(["at", "repeat"])
    write_bytes(path, rows.to_csv(index=False, float_format="%.5g").encode())


if __name__ == "__main__":
    sys.exit(main())
