"""Figures from the results of runs, with matplotlib on its own canvas (no screen, no global state)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sidegan.report.tables import ordered, title
from sidegan.storage import replacing

_PANELS = {
    "success": ("success rate", False),
    "condition": ("median cond(YᵀY)", True),
    "distance": ("mean distance of coefficients", False),
    "rank": ("effective rank of coefficients", False),
    "nearest": ("nearest distance", False),
    "distance_diagonal": ("mean distance of diag(YᵀY)", False),
}
_COLOURS = {"vanilla": "#7f7f7f", "eigen": "#1f77b4", "diagonal": "#d95f02", "seeds": "#6a3d9a"}
_LONG, _OTHER = "#b2182b", "#4d9221"

History = Sequence[Mapping[str, float | None]]


def training(histories: Mapping[str, Sequence[History]], seeds: Mapping[str, Any]) -> Figure:
    """Metrics with the true physics after every epoch, the seed set dashed.

    Args:
        histories: of every training of each variant; the line is their mean, the band their range.
        seeds: the same metrics of the seed set.
    """
    figure = _figure(11, 6)
    axes = figure.subplots(2, 3).ravel()
    for axis, (key, (label, logarithmic)) in zip(axes, _PANELS.items()):
        for name, runs in histories.items():
            values = np.array([[_value(row.get(key)) for row in history] for history in runs])
            epochs = range(1, values.shape[1] + 1)
            axis.plot(epochs, values.mean(0), label=name, color=_colour(name), linewidth=1.4)
            axis.fill_between(
                epochs, values.min(0), values.max(0), color=_colour(name), alpha=0.2, linewidth=0
            )
        reference = seeds.get("valid" if key == "success" else key)
        if reference is not None:
            axis.axhline(reference, color=_COLOURS["seeds"], linestyle="--", linewidth=1.2, label="seeds")
        if logarithmic:
            axis.set_yscale("log")
        axis.set_title(label, fontsize=10)
        axis.set_xlabel("epoch", fontsize=9)
        axis.grid(alpha=0.25)
    axes[0].legend(fontsize=8, frameon=False)
    figure.suptitle("Training, measured with the true physics", fontsize=11)
    return figure


def _value(x: float | None) -> float:
    return float("nan") if x is None else x


def errors(raw: pd.DataFrame) -> Figure:
    """NMSE by joint and set on a logarithmic axis, unweighted and weighted."""
    figure = _figure(11, 4.2)
    weightings = sorted(raw.weighted.unique())
    names, joints = ordered(raw["set"].unique()), list(dict.fromkeys(raw.joint))
    for axis, weighted in zip(figure.subplots(1, len(weightings), sharey=True, squeeze=False)[0], weightings):
        part = raw[raw.weighted == weighted].groupby(["set", "joint"]).nmse
        width = 0.8 / len(names)
        for k, name in enumerate(names):
            mean = [part.mean()[name, joint] for joint in joints]
            places = [i + (k - (len(names) - 1) / 2) * width for i in range(len(joints))]
            axis.bar(places, mean, width, label=title(name), color=_colour(name))
        axis.set_yscale("log")
        axis.set_xticks(range(len(joints)), joints, fontsize=8)
        axis.set_title("weighted per joint" if weighted else "unweighted, as in the paper", fontsize=10)
        axis.grid(axis="y", alpha=0.25)
    figure.axes[0].set_ylabel("nMSE")
    figure.axes[-1].legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
    return figure


def save(figure: Figure, path: Path) -> list[Path]:
    """Write ``path``.png and ``path``.svg."""
    written = []
    for suffix in (".png", ".svg"):
        final = path.with_suffix(suffix)
        with replacing(final) as draft:
            figure.savefig(draft, format=suffix[1:], dpi=150)
        written.append(final)
    return written


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _colour(name: str) -> str:
    if name.startswith("long"):
        return _LONG if name == "long-6" else "#f4a582"
    return _COLOURS.get(name, _OTHER)
