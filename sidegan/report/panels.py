"""Several columns over one, each in a panel of its own, a line for every run."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from sidegan.report.canvas import blank, legend, tidy
from sidegan.report.style import colour, colours
from sidegan.report.summary import require

_SUBS = (1.0, 2.0, 5.0)  # of each decade, that are ticks
_LOW, _HIGH = 0.9, 1.005  # ends of the axis of a share, or lower


class Panel(NamedTuple):
    """One column and how it is drawn.

    Attributes:
        key: the column.
        label: what to call it.
        log: a logarithmic axis.
        references: dashed lines, by the set whose value they are.
        share: of a whole, so that the axis ends at one.
    """

    key: str
    label: str
    log: bool = False
    references: Mapping[str, float] = {}
    share: bool = False


def panels(
    frame: pd.DataFrame,
    x: str,
    wanted: list[Panel],
    group: str,
    run: str,
    *,
    x_label: str,
    log_x: bool = False,
    markers: bool = False,
) -> Figure:
    """Every wanted column over column ``x``, two panels in a row; runs of a group share their colour.

    Args:
        frame: a row per result.
        x: the column across.
        wanted: the columns up.
        group: the column that tells colours apart.
        run: the column that tells lines of one colour apart.
        x_label: what to call ``x``.
        log_x: a logarithmic axis across.
        markers: a dot at every result.

    Raises:
        ConfigError: when the frame lacks a column.
    """
    require(frame, [x, group, run, *(panel.key for panel in wanted)])
    rows = -(-len(wanted) // 2)
    figure = blank(10, 3.1 * rows + 0.6)
    shades = colours(frame[group].astype(str))
    handles: dict[str, Any] = {}
    for axis, panel in zip(figure.subplots(rows, 2, squeeze=False).ravel(), wanted):
        for (name, _), part in frame.dropna(subset=[x, panel.key]).groupby([group, run], sort=False):
            handles[str(name)] = _line(axis, part.sort_values(x), (x, panel.key), shades[str(name)], markers)
        for name, value in panel.references.items():
            shade = shades.get(name, colour(name))
            handles[name] = axis.axhline(value, color=shade, linestyle="--", linewidth=1.3)
        _scale(axis, "x", log_x)
        _scale(axis, "y", panel.log)
        if panel.share:
            axis.set_ylim(min(axis.get_ylim()[0], _LOW), _HIGH)
        axis.set_title(panel.label, fontsize=10)
        axis.set_xlabel(x_label, fontsize=9)
        tidy(axis)
    legend(figure, {name: handles[name] for name in [*shades, *handles] if name in handles})
    return figure


def _scale(axis: Axes, which: Literal["x", "y"], log: bool) -> None:
    """A linear scale, or a logarithmic one whose ticks are plain numbers."""
    if log:
        axis.set(**{f"{which}scale": "log"})
        ticks = axis.xaxis if which == "x" else axis.yaxis
        ticks.set_major_locator(LogLocator(subs=_SUBS))
        ticks.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ticks.set_minor_formatter(NullFormatter())


def _line(axis: Axes, part: pd.DataFrame, columns: tuple[str, str], shade: str, markers: bool) -> Any:
    across, up = (part[name] for name in columns)
    marker = "o" if markers or len(part) == 1 else ""
    return axis.plot(across, up, color=shade, linewidth=1.4, alpha=0.9, marker=marker, markersize=4)[0]
