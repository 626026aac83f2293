"""Figures from the results of runs, with matplotlib on its own canvas (no screen, no global state)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sidegan.report.canvas import band, blank, legend, points, save, tidy
from sidegan.report.style import PANELS, colour, colours, seconds
from sidegan.report.summary import (
    History,
    aligned,
    by_joint,
    compared_with,
    curves,
    durations,
    epochs,
    is_text,
    require,
    time_ticks,
    weighting,
)
from sidegan.report.tables import ordered, title

__all__ = ["History", "curve", "errors", "quality_diversity", "save", "timing", "training"]

_FEW = 8  # places across that can all be ticks
_CROWD = 50  # points of a kind from which on they are drawn small and faint


def training(
    histories: Mapping[str, Sequence[History]],
    seeds: Mapping[str, Any],
    union: Mapping[str, Any] | None = None,
) -> Figure:
    """Metrics with the true physics after every epoch, the seed set dashed.

    Args:
        histories: of every training of each variant; the line is their mean, the band their range.
        seeds: the same metrics of the seed set.
        union: the same metrics of the seeds and generated trajectories together.
    """
    figure = blank(11, 6.2)
    handles: dict[str, Any] = {}
    for axis, (key, (label, logarithmic)) in zip(figure.subplots(2, 3).ravel(), PANELS.items()):
        for name, runs in histories.items():
            handles[name] = band(axis, epochs(runs, key), name, colour(name))
        for name, words, reference in compared_with(key, seeds, union):
            handles[words] = axis.axhline(
                reference, color=colour(name), linestyle="--", linewidth=1.3, label=words
            )
        if logarithmic:
            axis.set_yscale("log")
        if key == "success":
            axis.set_ylim(-0.03, 1.03)
        axis.set_title(label, fontsize=10)
        axis.set_xlabel("epoch", fontsize=9)
        tidy(axis)
    figure.suptitle("Training, measured with the true physics", fontsize=11)
    legend(figure, handles)
    return figure


def errors(raw: pd.DataFrame) -> Figure:
    """NMSE by joint and set on a logarithmic axis, unweighted and weighted; the whiskers are the range."""
    figure = blank(11, 4.4)
    weightings = sorted(raw.weighted.unique())
    names, joints = ordered(raw["set"].unique()), list(dict.fromkeys(raw.joint))
    width = 0.8 / len(names)
    look = {"ecolor": "#404040", "error_kw": {"elinewidth": 0.7, "capsize": 1.5}}
    handles = {}
    for axis, weighted in zip(figure.subplots(1, len(weightings), sharey=True, squeeze=False)[0], weightings):
        for name, line in by_joint(raw[raw.weighted == weighted]).items():
            places = [
                joints.index(joint) + (names.index(name) - (len(names) - 1) / 2) * width for joint in line.x
            ]
            ends = [line.mean - line.low, line.high - line.mean]
            bars = axis.bar(
                places, line.mean, width, yerr=ends, color=colour(name), label=title(name), **look
            )
            handles[title(name)] = bars
        axis.set_yscale("log")
        axis.set_xticks(range(len(joints)), joints)
        axis.set_title(weighting(weighted), fontsize=10)
        tidy(axis, "y")
    figure.axes[0].set_ylabel("nMSE", fontsize=9)
    legend(figure, handles)
    return figure


def curve(
    frame: pd.DataFrame,
    x: str,
    y: str,
    group: str | None = None,
    *,
    log_x: bool = False,
    log_y: bool = False,
    labels: Mapping[str, str] | None = None,
    references: Mapping[str, float] | None = None,
) -> Figure:
    """Column ``y`` over column ``x``: a line through the means and a band over the range of each group.

    Args:
        frame: a row per result; rows that share group and x are repetitions. An ``x`` of text gives
            places in the order of appearance.
        x: the column across.
        y: the column up.
        group: the column that tells lines apart.
        log_x: a logarithmic axis across.
        log_y: a logarithmic axis up.
        labels: what to call columns and groups.
        references: dashed lines at these values.

    Raises:
        ConfigError: when the frame lacks a column.
        ShapeError: when no row knows both x and y.
    """
    words = labels or {}
    figure = blank(7.2, 4.2)
    axis = figure.subplots()
    found = aligned(curves(frame, x, y, group))
    handles = {}
    for k, (name, shade) in enumerate(colours(found).items()):
        known = words.get(name, name)
        if is_text(frame[x]):
            shift = 0.12 * (k - (len(found) - 1) / 2)
            handles[known] = points(axis, found[name], known, shade, shift)
        else:
            handles[known] = band(axis, found[name], known, shade, marker="o")
    for name, value in (references or {}).items():
        known = words.get(name, name)
        handles[known] = axis.axhline(value, color=colour(name), linestyle="--", linewidth=1.3, label=known)
    if log_x:
        _log_places(axis, next(iter(found.values())).x)
    if log_y:
        axis.set_yscale("log")
    axis.set_xlabel(words.get(x, x), fontsize=9)
    axis.set_ylabel(words.get(y, y), fontsize=9)
    tidy(axis)
    legend(figure, {name: handle for name, handle in handles.items() if name})
    return figure


def _log_places(axis: Axes, places: np.ndarray) -> None:
    """A logarithmic axis across; where the places are few, the ticks are at them."""
    axis.set_xscale("log")
    if len(places) <= _FEW:
        axis.set_xticks(places, [f"{place:g}" for place in places])
        axis.minorticks_off()


def quality_diversity(
    frame: pd.DataFrame,
    quality: str,
    diversity: str,
    kind: str,
    *,
    log: bool = True,
    labels: Mapping[str, str] | None = None,
) -> Figure:
    """A point per row: diversity across, quality up, coloured by kind; the crosses are the medians.

    Raises:
        ConfigError: when the frame lacks a column.
    """
    require(frame, [quality, diversity, kind])
    words = labels or {}
    figure = blank(6.4, 4.4)
    axis = figure.subplots()
    handles: dict[str, Any] = {}
    for name, shade in colours(frame[kind].astype(str)).items():
        part = frame[frame[kind].astype(str) == name]
        known = f"{words.get(name, name)} ({len(part)})"
        size, opacity = (28, 0.85) if len(part) < _CROWD else (14, 0.4)
        handles[known] = axis.scatter(
            part[diversity], part[quality], s=size, color=shade, alpha=opacity, linewidths=0, label=known
        )
        median = axis.plot(part[diversity].median(), part[quality].median(), "P", color=shade)[0]
        median.set(markersize=13, markeredgecolor="white")
    handles["median"] = Line2D([], [], marker="P", color="#404040", linestyle="", markersize=9)
    axis.set_yscale("log" if log else "linear")
    axis.set_xlabel(words.get(diversity, diversity), fontsize=9)
    axis.set_ylabel(words.get(quality, quality), fontsize=9)
    tidy(axis)
    legend(figure, handles)
    return figure


def timing(frame: pd.DataFrame) -> Figure:
    """Durations on a logarithmic axis, ours below the paper's, each written at its bar.

    Args:
        frame: columns ``what``, and ``ours`` and ``paper`` [s]; NaN where a duration is not known.

    Raises:
        ConfigError: when the frame lacks a column.
        ShapeError: when no duration is known.
    """
    figure = blank(8.6, 0.62 * len(frame) + 1.1)
    axis = figure.subplots()
    low, high = durations(frame)
    handles = {}
    for name, shift in (("paper", -0.2), ("ours", 0.2)):
        known = frame[name].notna().to_numpy()
        places = (np.arange(len(frame)) + shift)[known]
        handles[name] = axis.barh(
            places, frame[name][known] - low, 0.36, left=low, color=colour(name), label=name
        )
        for place, value in zip(places, frame[name][known]):
            axis.text(value * 1.15, place, seconds(value), va="center", fontsize=8)
    axis.set_xscale("log")
    axis.set_xlim(low, high)
    axis.set_yticks(range(len(frame)), frame.what)
    axis.invert_yaxis()
    ticks = time_ticks(low, high)
    axis.set_xticks(ticks, [seconds(t) for t in ticks])
    axis.minorticks_off()
    tidy(axis, "x")
    legend(figure, handles)
    return figure
