"""Medians, exponents and pictures of the growth curves, and the page docs/growth/README.md."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.ticker import NullLocator, StrMethodFormatter
from scipy.stats import linregress

from benchmarks.soak import outcome
from sidegan.base.storage import write_bytes
from sidegan.report.canvas import Line, band, blank, save, tidy
from sidegan.report.document import template
from sidegan.report.export import markdown
from sidegan.report.style import PALETTE

_FITTED = 4  # largest points that an exponent is fitted to
_WIDTH, _HEIGHT = 5.5, 3.7  # of a panel [inch]


def exponent(curve: Mapping[str, Any], rows: pd.DataFrame, column: str) -> tuple[float, float]:
    """Power with which the total cost grows at the largest points, and its standard error."""
    medians = rows.groupby("at")[column].median().tail(_FITTED)
    fit = linregress(np.log(medians.index.to_numpy(float)), np.log(medians.to_numpy()))
    return float(fit.slope) + curve.get("share", False), float(np.nan_to_num(fit.stderr))


def draw(curve: Mapping[str, Any], rows: pd.DataFrame, path: Path) -> None:
    """A picture of the medians with their ranges, logarithmic both ways; memory beside it where it counts."""
    panels = [(curve["shown"], curve["unit"])]
    if curve.get("memory"):
        panels.append(({"peak_mb": "memory"}, "peak memory of the process [MB]"))
    figure = blank(_WIDTH * len(panels), _HEIGHT)
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


def write_page(curves: Mapping[str, Mapping[str, Any]], folder: Path) -> None:
    """Write ``README.md`` of a folder: a section for each curve whose table is there."""
    sections = {
        name: _section(name, one, folder) for name, one in curves.items() if (folder / f"{name}.csv").exists()
    }
    soak = outcome(pd.read_csv(folder / "soak.csv")) if (folder / "soak.csv").exists() else ""
    page = template(Path(__file__).with_name("growth.md.j2")).render(curves=sections, soak=soak)
    write_bytes(folder / "README.md", page.encode())


def _section(name: str, curve: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """What the template fills in for one curve."""
    rows = pd.read_csv(folder / f"{name}.csv")
    groups = rows.groupby("at")
    columns = curve["shown"] | ({"peak_mb": "peak memory [MB]"} if curve.get("memory") else {})
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
