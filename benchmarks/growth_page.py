"""Medians, exponents and pictures of the growth curves, and the page docs/growth/README.md."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator, StrMethodFormatter
from scipy.stats import linregress

from benchmarks.soak import outcome
from sidegan.base.storage import replacing, write_bytes

_FITTED = 4  # largest points that an exponent is fitted to
_PANEL, _RESOLUTION = (5.5, 3.7), 130  # [inch], [1/inch]


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
    figure = Figure((_PANEL[0] * len(panels), _PANEL[1]), layout="constrained")
    groups = rows.groupby("at")
    for axes, (shown, label) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels):
        for column, name in shown.items():
            low, middle, high = groups[column].min(), groups[column].median(), groups[column].max()
            (line,) = axes.plot(middle.index, middle, "o-", markersize=4, label=name)
            axes.fill_between(middle.index, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
        axes.set(xlabel=curve["varied"], ylabel=label, xscale="log")
        axes.set_xticks(middle.index, [f"{at:,}" for at in middle.index])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(alpha=0.25)
        if "peak_mb" in shown:
            axes.set_ylim(0, 1.2 * rows["peak_mb"].max())
        else:
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            axes.yaxis.set_minor_formatter(NullFormatter())
            axes.legend(fontsize=8, frameon=False)
    with replacing(path) as draft:
        figure.savefig(draft, format="png", dpi=_RESOLUTION, metadata={"Software": None})


def write_page(curves: Mapping[str, Mapping[str, Any]], folder: Path) -> None:
    """Write ``README.md`` of a folder: a section for each curve whose table is there."""
    sections = {
        name: _section(name, one, folder) for name, one in curves.items() if (folder / f"{name}.csv").exists()
    }
    soak = outcome(pd.read_csv(folder / "soak.csv")) if (folder / "soak.csv").exists() else ""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    page = environment.get_template("growth.md.j2").render(curves=sections, soak=soak)
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
        "table": _markdown(table.assign(repeats=groups.size().astype(str))),
        "exponents": ", ".join(f"{words} {powers[column]}" for column, words in curve["shown"].items()),
        "power": powers,
        "largest": rows["at"].max(),
        "last": groups.median().iloc[-1],
    }


def _markdown(table: pd.DataFrame) -> str:
    lines: list[list[str]] = [list(map(str, table)), ["---"] * table.shape[1], *table.to_numpy().tolist()]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
