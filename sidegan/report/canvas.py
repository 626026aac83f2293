"""What all matplotlib figures share: the canvas, bands, axes, legends, files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sidegan.base.storage import replacing


class Line(NamedTuple):
    """Mean, lowest and highest value, (N,) each, at N places."""

    x: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray


def blank(width: float, height: float) -> Figure:
    """An empty figure of this size [inch] on a canvas of its own: no screen, no global state."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def band(axis: Axes, line: Line, label: str, shade: str, marker: str | None = None) -> Line2D:
    """The line through the means, with the range behind it."""
    if (np.nan_to_num(line.high - line.low) > 0).any():
        axis.fill_between(line.x, line.low, line.high, color=shade, alpha=0.2, linewidth=0)
    style = {"marker": marker, "markersize": 4} if marker or len(line.x) > 1 else {"marker": "o"}
    return axis.plot(line.x, line.mean, label=label, color=shade, linewidth=1.5, **style)[0]


def tidy(axis: Axes, grid: Literal["both", "x", "y"] = "both") -> None:
    """A light grid behind the data, small ticks, no frame on the right and above."""
    axis.grid(axis=grid, alpha=0.25)
    axis.set_axisbelow(True)
    axis.tick_params(which="both", labelsize=8)
    axis.spines[["right", "top"]].set_visible(False)


def legend(figure: Figure, handles: Mapping[str, Any]) -> None:
    """One legend below all panels; none for a single unnamed line."""
    if handles:
        rows = -(-len(handles) // int(figure.get_figwidth() // 1.7))
        columns = -(-len(handles) // rows)
        figure.legend(
            list(handles.values()),
            list(handles),
            loc="outside lower center",
            ncols=columns,
            fontsize=9,
            frameon=False,
        )


def save(figure: Figure, path: Path) -> Path:
    """Write ``path``.png; the same figure gives the same bytes, so that a repeated run changes no file."""
    final = path.with_name(f"{path.name}.png")
    with replacing(final) as draft:
        figure.savefig(draft, format="png", dpi=150, metadata={"Software": None})
    return final
