"""Figures from the results of runs, with matplotlib."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from sidegan.report.canvas import blank, legend, logarithmic, tidy
from sidegan.report.style import colour, colours
from sidegan.report.tables import NAMES, ordered, title, weighting

_METRICS = ("success", "condition", "distance", "rank", "nearest", "distance_diagonal")
_LOW, _HIGH = 0.9, 1.005  # ends of the axis of a share, or lower


class Panel(NamedTuple):
    """One column and how it is drawn."""

    key: str
    label: str  # for people
    log: bool = False  # whether the axis is logarithmic
    references: Mapping[str, float] = {}  # dashed lines, by the set whose value they are
    share: bool = False  # of a whole, so that the axis ends at one


def metrics(references: Mapping[str, Mapping[str, float]]) -> list[Panel]:
    """A panel for each metric of a generator, with the values of the sets that it is compared with."""
    panels = []
    for key in _METRICS:
        compared = {name: x[key] for name, x in references.items() if x.get(key) is not None}
        panels.append(Panel(key, NAMES[key], key == "condition", compared, key == "success"))
    return panels


def panels(
    frame: pd.DataFrame,
    across: tuple[str, str],
    shown: Sequence[Panel],
    group: str,
    columns: int = 2,
    markers: bool = False,
) -> Figure:
    """Columns of a frame over another one, a panel each; a group is a line of means with its range behind.

    Args:
        frame: a row per result.
        across: the column across, and its name for people.
        shown: the columns up.
        group: the column that tells colours apart.
        columns: panels beside each other.
        markers: a dot at every result.
    """
    (key, label), columns = across, min(columns, len(shown))
    rows = -(-len(shown) // columns)
    figure = blank(7.2 if columns == 1 else 3.7 * columns + 0.5, 3.1 * rows + (1.1 if columns == 1 else 0.6))
    shades = colours(frame[group].astype(str))
    handles: dict[str, Any] = {}
    for axis, panel in zip(figure.subplots(rows, columns, squeeze=False).ravel(), shown):
        drawn = frame.dropna(subset=[key, panel.key])
        for name, part in drawn.groupby(group, sort=False):
            line = part.groupby(key)[panel.key].agg(["mean", "min", "max"])
            dots = {"marker": "o", "markersize": 4} if markers or len(line) == 1 else {}
            style: dict[str, Any] = {"color": shades[str(name)]}
            if (line["max"] > line["min"]).any():
                axis.fill_between(line.index, line["min"], line["max"], **style, alpha=0.2, linewidth=0)
            (handles[str(name)],) = axis.plot(line["mean"], **style, **dots, linewidth=1.5)
        for name, value in panel.references.items():
            shade = shades.get(name, colour(name))
            handles[name] = axis.axhline(value, color=shade, linestyle="--", linewidth=1.3)
        if panel.log:
            logarithmic(axis)
        if panel.share:
            axis.set_ylim(min(axis.get_ylim()[0], _LOW), _HIGH)
        axis.set_title(panel.label, fontsize=10)
        axis.set_xlabel(label, fontsize=9)
        tidy(axis)
    legend(figure, {name: handles[name] for name in [*shades, *handles] if name in handles})
    return figure


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
