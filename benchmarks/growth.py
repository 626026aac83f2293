"""The command ``python -m benchmarks.growth``: how costs grow, as tables, pictures and a page in docs/growth.

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

import numpy as np
import pandas as pd
import yaml
from matplotlib.ticker import NullLocator, StrMethodFormatter
from scipy.stats import linregress

from benchmarks import curves
from benchmarks.soak import FOLDER, outcome
from sidegan.base.storage import write_bytes
from sidegan.report.canvas import Line, band, blank, save, tidy
from sidegan.report.document import template
from sidegan.report.export import markdown
from sidegan.report.style import PALETTE

Curve = dict[str, Any]  # an entry of growth.yaml

CURVES: dict[str, Curve] = yaml.safe_load(Path(__file__).with_name("growth.yaml").read_text("utf-8"))

_CONTEXT = get_context("forkserver")
_CONTEXT.set_forkserver_preload(["benchmarks.curves"])  # imported once, and not for each point
_FITTED = 4  # largest points that an exponent is fitted to


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.growth", description="How costs grow.")
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
        each = 1 if "memory" in CURVES[name] else None
        with ProcessPoolExecutor(1, _CONTEXT, curves.warm_up, max_tasks_per_child=each) as pool:
            for at, repeat in turns(CURVES[name], options.small, options.repeats):
                _measure(pool, name, at, repeat, path)
        draw(CURVES[name], pd.read_csv(path), path.with_suffix(""))
    tables = {path.stem: pd.read_csv(path) for path in options.folder.glob("*.csv")}
    sections = {name: _section(curve, tables[name]) for name, curve in CURVES.items() if name in tables}
    soak = outcome(tables["soak"]) if "soak" in tables else ""
    page = template(Path(__file__).with_name("growth.md.j2")).render(curves=sections, soak=soak)
    write_bytes(options.folder / "README.md", page.encode())
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


def exponent(curve: Curve, rows: pd.DataFrame, column: str) -> tuple[float, float]:
    """Power with which the total cost grows at the largest points, and its standard error."""
    medians = rows.groupby("at")[column].median().tail(_FITTED)
    fit = linregress(np.log(medians.index.to_numpy(float)), np.log(medians.to_numpy()))
    return float(fit.slope) + curve.get("share", False), float(np.nan_to_num(fit.stderr))


def draw(curve: Curve, rows: pd.DataFrame, path: Path) -> None:
    """A picture of the medians with their ranges, logarithmic both ways; memory beside it where it counts."""
    panels = [(curve["shown"], curve["unit"])]
    if "memory" in curve:
        panels.append(({"peak_mb": "memory"}, "peak memory of the process [MB]"))
    figure = blank(5.5 * len(panels), 3.7)
    groups = rows.groupby("at")
    for axes, (shown, label) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels):
        for (column, name), shade in zip(shown.items(), PALETTE):
            values = groups[column].agg(["median", "min", "max"])
            band(axes, Line(values.index.to_numpy(), *values.to_numpy().T), name, shade, "o")
        axes.set(xlabel=curve["varied"], ylabel=label, xscale="log")
        axes.set_xticks(values.index, [f"{at:,}" for at in values.index])
        axes.xaxis.set_minor_locator(NullLocator())
        if "peak_mb" in shown:
            axes.set_ylim(0, 1.2 * rows["peak_mb"].max())
        else:
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            axes.legend(fontsize=8, frameon=False)
        tidy(axes)
    save(figure, path)


def _section(curve: Curve, rows: pd.DataFrame) -> dict[str, Any]:
    """What the template fills in for one curve."""
    groups = rows.groupby("at")
    columns = curve["shown"] | ({"peak_mb": "peak memory [MB]"} if "memory" in curve else {})
    table = groups[list(columns)].median().rename(columns=columns).map(_number)
    table.insert(0, curve["varied"], [f"{at:,}" for at in table.index])
    fitted = set(rows.columns) & {"fitness_s"} | set(curve["shown"])
    powers = {column: "{:.2f} ± {:.2f}".format(*exponent(curve, rows, column)) for column in fitted}
    return {
        "share": False,
        **curve,
        "table": markdown(table.assign(repeats=groups.size().astype(str))),
        "exponents": ", ".join(f"{words} {powers[column]}" for column, words in curve["shown"].items()),
        "power": powers,
        "largest": rows["at"].max(),
        "last": groups.median().iloc[-1],
    }


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
