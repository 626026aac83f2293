"""Figures from the results of runs, with matplotlib."""

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.sets import colour, colours, sort_sets, title, weighting
from experiments.tables import LIKENESS, WORTH
from sidegan.report.canvas import blank, from_zero, legend, letter, logarithmic, tidy

# Metrics of a generator, with the labels of their panels.
METRICS = {
    "invalid": "invalid share",
    "condition": WORTH["condition"],
    "condition_mean": "mean cond(YᵀY)",
    "error": "expected nMSE, noise of 10 % of the torque",
    "error_constant": "expected nMSE, constant noise",
    "distance": "mean distance [rad/s]",
    "cosine": WORTH["cosine"],
    "rank_uncentred": WORTH["rank_uncentred"],
    "distance_diagonal": LIKENESS["distance_diagonal"],
}
_SCALE = {"condition_mean": "condition", "error_constant": "error"}  # whose axis a metric shares
_CLOUD = 200  # points of a set


def panels(frame: pd.DataFrame, references: Mapping[str, Mapping[str, float]]) -> Figure:
    """``METRICS`` of variants against the epoch, a panel each, with the mean and range of each variant.

    Args:
        frame: a row per variant, training and epoch.
        references: the metrics of sets to compare with, drawn dashed.
    """
    figure = blank(11.6, 9.9)
    variants = sort_sets(frame.variant.unique())
    handles: dict[str, Any] = {}
    axes = dict(zip(METRICS, figure.subplots(3, 3).ravel()))
    for metric, axis in axes.items():
        if metric in _SCALE:
            axis.sharey(axes[_SCALE[metric]])
        for name, part in frame.dropna(subset=metric).groupby("variant", sort=False):
            line = part.groupby("epoch")[metric].agg(["mean", "min", "max"])
            shade = colour(str(name))
            axis.fill_between(line.index, line["min"], line["max"], color=shade, alpha=0.2, linewidth=0)
            handles[str(name)] = axis.plot(line["mean"], color=shade, linewidth=1.5)[0]
        for name, values in references.items():
            if values.get(metric) is not None:
                handles[name] = axis.axhline(values[metric], color=colour(name), ls="--", lw=1.3)
        if metric in {*_SCALE, *_SCALE.values()}:
            logarithmic(axis)
        elif metric == "invalid":
            from_zero(axis, frame[metric])
        axis.set_xlabel("epoch", fontsize=9)
        axis.set_ylabel(fill(METRICS[metric], 30), fontsize=9)
        tidy(axis)
    letter([*axes.values()])
    legend(figure, {name: handles[name] for name in [*variants, *handles] if name in handles})
    return figure


def errors(raw: pd.DataFrame) -> Figure:
    """NMSE by joint and set, unweighted and weighted: means, and whiskers over the range."""
    figure = blank(11, 4.4)
    names = sort_sets(raw["set"].unique())
    joints = list(dict.fromkeys(raw.joint))
    places = np.arange(len(joints)) - 0.4
    parts = raw.groupby("weighted")
    axes = figure.subplots(1, len(parts), sharey=True, squeeze=False)[0]
    for axis, (weighted, part) in zip(axes, parts):
        found = part.groupby(["set", "joint"]).nmse.agg(["mean", "min", "max"])
        style = {"fmt": "o", "markersize": 3, "elinewidth": 0.8, "capsize": 1.5}
        handles = {}
        for k, (name, shade) in enumerate(zip(names, colours(names))):
            own = found.loc[name].loc[joints]
            x = places + 0.8 * (k + 0.5) / len(names)
            ends = [own["mean"] - own["min"], own["max"] - own["mean"]]
            handles[title(name)] = axis.errorbar(x, own["mean"], ends, color=shade, **style)
        axis.set_xticks(range(len(joints)), joints)
        axis.set_title(weighting(bool(weighted)), fontsize=10)
        logarithmic(axis)
        tidy(axis, "y")
    axes[0].set_ylabel("nMSE", fontsize=9)
    letter(axes)
    legend(figure, handles)
    return figure


def clouds(spaces: Mapping[str, Mapping[str, np.ndarray]]) -> Figure:
    """Sets in spaces, (N, D) each, on the two directions in which all of a space vary most: a row each.

    Every set but the first is drawn beside the first; all panels of a space have the same axes.
    """
    columns = max(map(len, spaces.values())) - 1
    figure = blank(2.4 * columns + 0.6, 2.6 * len(spaces) + 0.3)
    axes = figure.subplots(len(spaces), columns, squeeze=False, sharex="row", sharey="row")
    handles = {}
    for row, (space, sets) in zip(axes, spaces.items()):
        every = np.concatenate([x[:_CLOUD] for x in sets.values()])
        _, size, directions = np.linalg.svd(every - every.mean(0), full_matrices=False)
        share = 100 * size**2 / (size**2).sum()
        first, *others = sets
        for axis, name in zip(row, others):
            for label in (first, name):
                xy = directions[:2] @ (sets[label][:_CLOUD] - every.mean(0)).T
                handles[label] = axis.scatter(*xy, s=7, color=colour(label), alpha=0.6, linewidths=0)
            axis.set_title(name, fontsize=10)
            axis.set_xlabel(f"{space}, axis 1 ({share[0]:.0f} %)", fontsize=8)
            axis.set_box_aspect(1)
            axis.locator_params(nbins=5)
            tidy(axis)
        row[0].set_ylabel(f"{space}, axis 2 ({share[1]:.0f} %)", fontsize=8)
    letter(axes.ravel())
    legend(figure, handles)
    return figure
