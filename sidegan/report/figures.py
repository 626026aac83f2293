"""Figures from the results of runs, with matplotlib."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sidegan.report.canvas import blank, legend, logarithmic, tidy
from sidegan.report.style import colour, colours
from sidegan.report.tables import NAMES, ordered, title, weighting

METRICS = ["success", "condition", "condition_mean", "error", "error_constant", "distance"]  # of a generator
METRICS += ["cosine", "rank_uncentred", "distance_diagonal"]
_LOW, _HIGH = 0.9, 1.005  # limits of an axis of shares; the lower one adapts to the data
_FEW = 10  # lines with fewer points have markers


def panels(
    frame: pd.DataFrame,
    across: tuple[str, str],
    shown: Sequence[str],
    references: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
) -> Figure:
    """Metrics of variants against a column, a panel per metric, with the mean and range of each variant.

    Args:
        frame: a row per result, with its ``variant``.
        across: column of the x axis, and its label.
        shown: the metrics.
        references: the metrics of sets to compare with, drawn dashed.
    """
    key, label = across
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = blank(7.2 if columns == 1 else 3.7 * columns + 0.5, 3.1 * rows + (1.1 if columns == 1 else 0.6))
    variants = ordered(frame.variant.unique())
    handles: dict[str, Any] = {}
    for axis, metric in zip(figure.subplots(rows, columns, squeeze=False).ravel(), shown):
        for name, part in frame.dropna(subset=[key, metric]).groupby("variant", sort=False):
            handles[str(name)] = _line(axis, part.groupby(key)[metric].agg(["mean", "min", "max"]), str(name))
        for name, values in references.items():
            if values.get(metric) is not None:
                handles[name] = axis.axhline(values[metric], color=colour(name), ls="--", lw=1.3)
        if metric in ("condition", "condition_mean", "error", "error_constant"):
            logarithmic(axis)
        if metric == "success":
            axis.set_ylim(min(axis.get_ylim()[0], _LOW), _HIGH)
        axis.set_title(NAMES[metric], fontsize=10)
        axis.set_xlabel(label, fontsize=9)
        tidy(axis)
    legend(figure, {name: handles[name] for name in [*variants, *handles] if name in handles})
    return figure


def _line(axis: Axes, line: pd.DataFrame, name: str) -> Line2D:
    """Line of a variant's means, over a band of the range."""
    if (line["max"] > line["min"]).any():
        axis.fill_between(line.index, line["min"], line["max"], color=colour(name), alpha=0.2, linewidth=0)
    marker = "o" if len(line) < _FEW else ""
    return axis.plot(line["mean"], color=colour(name), marker=marker, markersize=4, linewidth=1.5)[0]


def errors(raw: pd.DataFrame) -> Figure:
    """NMSE by joint and set on a logarithmic axis, unweighted and weighted; the whiskers are the range."""
    figure = blank(11, 4.4)
    names = ordered(raw["set"].unique())
    joints = list(dict.fromkeys(raw.joint))
    parts = raw.groupby("weighted")
    for axis, (weighted, part) in zip(figure.subplots(1, len(parts), sharey=True, squeeze=False)[0], parts):
        groups = part.groupby(["joint", "set"]).nmse
        mean, low, high = (groups.agg(how).unstack().loc[joints, names] for how in ("mean", "min", "max"))
        mean.plot.bar(
            ax=axis,
            yerr=np.stack([(mean - low).T, (high - mean).T], 1),
            color=[*colours(names)],
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


def coefficients(sets: Mapping[str, np.ndarray]) -> Figure:
    """Coefficients of sets, (N, D) each, as images with a row per trajectory, and projected onto two axes.

    The axes are the leading directions of each set together with the first, not centred: a common offset
    of a set is far from the origin.
    """
    figure = blank(2.6 * len(sets) + 0.6, 5.6)
    strips, clouds = figure.subplots(2, len(sets), squeeze=False)
    (first, reference), *_ = sets.items()
    ends = float(np.abs(reference).max())
    for (name, rows), strip, cloud in zip(sets.items(), strips, clouds):
        colours = {"cmap": "RdBu_r", "vmin": -ends, "vmax": ends}
        drawn = strip.imshow(rows, aspect="auto", interpolation="nearest", **colours)
        strip.set_title(name, fontsize=10)
        strip.set_xlabel("coefficient", fontsize=9)
        strip.tick_params(labelsize=8)
        axes = np.linalg.svd(np.concatenate([reference, rows]), full_matrices=False)[2][:2]
        for label, x in ((first, reference), (name, rows)):
            cloud.scatter(*(axes @ x.T), s=9, color=colour(label), alpha=0.7, linewidths=0)
        reach = 1.05 * max(np.abs(axes @ x.T).max() for x in (reference, rows))
        cloud.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        cloud.locator_params(nbins=5)
        cloud.set_xlabel("first axis [rad/s]", fontsize=9)
        tidy(cloud)
    strips[0].set_ylabel("trajectory", fontsize=9)
    clouds[0].set_ylabel("second axis [rad/s]", fontsize=9)
    figure.colorbar(drawn, ax=list(strips), label="rad/s", shrink=0.8)
    return figure
