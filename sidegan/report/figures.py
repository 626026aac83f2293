"""Figures from the results of runs, with matplotlib."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from sidegan.report.canvas import Line, band, blank, legend, tidy
from sidegan.report.style import colour, colours, seconds
from sidegan.report.tables import NAMES, ordered, title, weighting

_METRICS = ("success", "condition", "distance", "rank", "nearest", "distance_diagonal")
_LOW, _HIGH = 0.9, 1.005  # ends of the axis of a share, or lower
_CROWD = 50  # points of a kind from which on they are drawn small and faint
_TIMES = (1e-6, 1e-3, 1.0, 60.0, 3600.0, 86400.0)  # [s] that may be ticks


class Panel(NamedTuple):
    """One column and how it is drawn."""

    key: str
    label: str  # for people
    log: bool = False  # whether the axis is logarithmic
    references: Mapping[str, float] = {}  # dashed lines, by the set whose value they are
    share: bool = False  # of a whole, so that the axis ends at one


class Across(NamedTuple):
    """The column across, its name for people, and whether its axis is logarithmic."""

    key: str
    label: str
    log: bool = False


def metrics(
    keys: Iterable[str] = _METRICS, references: Mapping[str, Mapping[str, float]] | None = None
) -> list[Panel]:
    """A panel for each metric of a generator, with the values of the sets that it is compared with."""
    panels = []
    for key in keys:
        compared = {name: x[key] for name, x in (references or {}).items() if x.get(key) is not None}
        panels.append(Panel(key, NAMES[key], key == "condition", compared, key == "success"))
    return panels


def panels(
    frame: pd.DataFrame,
    across: Across,
    shown: Sequence[Panel],
    group: str,
    run: str | None = None,
    columns: int = 2,
    markers: bool = False,
) -> Figure:
    """Columns of a frame over another one, a panel each; a group has one colour.

    Args:
        frame: a row per result.
        across: the column across.
        shown: the columns up.
        group: the column that tells colours apart.
        run: the column that tells lines of one colour apart; without it a group is the line through its
            means, with its range behind.
        columns: panels beside each other.
        markers: a dot at every result.
    """
    columns = min(columns, len(shown))
    rows = -(-len(shown) // columns)
    figure = blank(7.2 if columns == 1 else 3.7 * columns + 0.5, 3.1 * rows + (1.1 if columns == 1 else 0.6))
    shades = colours(frame[group].astype(str))
    handles: dict[str, Any] = {}
    for axis, panel in zip(figure.subplots(rows, columns, squeeze=False).ravel(), shown):
        drawn = frame.dropna(subset=[across.key, panel.key])
        for (name, *_), part in drawn.groupby([group, run] if run else [group], sort=False):
            values = part.groupby(across.key)[panel.key].agg(["mean", "min", "max"])
            line = Line(values.index.to_numpy(), *values.to_numpy(float).T)
            handles[str(name)] = band(axis, line, str(name), shades[str(name)], "o" if markers else None)
        for name, value in panel.references.items():
            shade = shades.get(name, colour(name))
            handles[name] = axis.axhline(value, color=shade, linestyle="--", linewidth=1.3)
        _scale(axis, "x", across.log)
        _scale(axis, "y", panel.log)
        if panel.share:
            axis.set_ylim(min(axis.get_ylim()[0], _LOW), _HIGH)
        axis.set_title(panel.label, fontsize=10)
        axis.set_xlabel(across.label, fontsize=9)
        tidy(axis)
    legend(figure, {name: handles[name] for name in [*shades, *handles] if name in handles})
    return figure


def _scale(axis: Axes, which: Literal["x", "y"], log: bool) -> None:
    """A linear scale, or a logarithmic one whose ticks are plain numbers."""
    if log:
        axis.set(**{f"{which}scale": "log"})
        ticks = axis.xaxis if which == "x" else axis.yaxis
        decades = np.ptp(np.log10(axis.get_xlim() if which == "x" else axis.get_ylim()))
        ticks.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 4 else (1.0,)))
        ticks.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ticks.set_minor_formatter(NullFormatter())


def errors(raw: pd.DataFrame) -> Figure:
    """NMSE by joint and set on a logarithmic axis, unweighted and weighted; the whiskers are the range."""
    figure = blank(11, 4.4)
    names, joints = ordered(raw["set"].unique()), list(dict.fromkeys(raw.joint))
    parts = raw.groupby("weighted")
    for axis, (weighted, part) in zip(figure.subplots(1, len(parts), sharey=True, squeeze=False)[0], parts):
        groups = part.groupby(["joint", "set"]).nmse
        mean, low, high = (
            x.unstack().loc[joints, names] for x in (groups.mean(), groups.min(), groups.max())
        )
        mean.plot.bar(
            ax=axis,
            yerr=np.stack([(mean - low).T, (high - mean).T], 1),
            color=[colour(name) for name in names],
            ecolor="#404040",
            error_kw={"elinewidth": 0.7, "capsize": 1.5},
            width=0.8,
            rot=0,
            logy=True,
            legend=False,
            xlabel="",
        )
        axis.set_title(weighting(bool(weighted)), fontsize=10)
        tidy(axis, "y")
    figure.axes[0].set_ylabel("nMSE", fontsize=9)
    legend(figure, dict(zip(map(title, names), axis.containers[1::2])))
    return figure


def quality_diversity(frame: pd.DataFrame, labels: tuple[str, str]) -> Figure:
    """A point per row of kind, diversity (across) and quality (up); the crosses are the medians of a kind."""
    figure = blank(7.2, 4.6)
    axis = figure.subplots()
    handles: dict[str, Any] = {}
    for name, shade in colours(frame.kind.astype(str)).items():
        part = frame[frame.kind.astype(str) == name]
        size, opacity = (28, 0.85) if len(part) < _CROWD else (14, 0.4)
        handles[f"{name} ({len(part)})"] = axis.scatter(
            part.diversity, part.quality, s=size, color=shade, alpha=opacity, linewidths=0
        )
        median = axis.plot(part.diversity.median(), part.quality.median(), "P", color=shade)[0]
        median.set(markersize=13, markeredgecolor="white")
    handles["median"] = Line2D([], [], marker="P", color="#404040", linestyle="", markersize=9)
    axis.set_yscale("log")
    axis.set_xlabel(labels[0], fontsize=9)
    axis.set_ylabel(labels[1], fontsize=9)
    tidy(axis)
    legend(figure, handles)
    return figure


def timing(frame: pd.DataFrame) -> Figure:
    """Durations ``ours`` and ``paper`` [s] of ``what`` on a logarithmic axis, each written at its bar.

    They are positive; NaN where there is no duration.
    """
    there = frame[["paper", "ours"]].to_numpy(float)
    # Room for what is written beside the bars.
    low, high = float(np.nanmin(there)) / 3, float(np.nanmax(there)) * 12
    figure = blank(8.6, 0.62 * len(frame) + 1.1)
    axis = figure.subplots()
    handles = {}
    for name, shift in (("paper", -0.2), ("ours", 0.2)):
        values = frame[name].astype(float).reset_index(drop=True).dropna()
        bars = axis.barh(values.index + shift, values - low, 0.36, left=low, color=colour(name), label=name)
        axis.bar_label(bars, [seconds(x) for x in values], padding=3, fontsize=8)
        handles[name] = bars
    axis.set_xscale("log")
    axis.set_xlim(low, high)
    axis.set_yticks(range(len(frame)), frame.what)
    axis.invert_yaxis()
    ticks = [tick for tick in _TIMES if low <= tick <= high]
    axis.set_xticks(ticks, [seconds(t) for t in ticks])
    axis.minorticks_off()
    tidy(axis, "x")
    legend(figure, handles)
    return figure
