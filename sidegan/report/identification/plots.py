"""Plots of an identification, for its report."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sidegan.report import canvas
from sidegan.report.identification.content import Numbers, Report, Signals, correlation_of

MEASURED, PREDICTED, RESIDUAL = "#8795a1", "#0b66c3", "#d9480f"
ROLES = {"training": "#8795a1", "validation": "#0b66c3"}
_JOINTS = ("#0b66c3", "#d9480f", "#1a7f4b", "#8e44ad", "#b26a00", "#0f8b8d", "#c2185b", "#5b6b7b")
_INK, _LINE, _GRID = "#1c2733", "#b8c2cb", "#e6ebef"
_WORDS = {"fontsize": 9.5, "color": _INK}
_STEPS = [1, 2, 5, 10]  # of ticks
_PIXEL = 1 / 96  # [inch]
_WIDE, _HALF = 1080, 560  # [px] of a section and of half of it
_POINTS = 1200  # of a line: as many as a screen can show
_CLOUD = 300  # samples of a friction curve
_RECORDINGS = 12  # that are shown
_LAGS = 60  # samples over which residuals are correlated
_NAMED = 60  # parameters up to which a correlation has its names beside it
_LONG = 60  # letters of names that have no room beside each other


def shown_recordings(signals: Sequence[Signals]) -> list[Signals]:
    """The recordings that the report shows, those of the validation first."""
    return sorted(signals, key=lambda one: one.role != "validation")[:_RECORDINGS]


def torques(report: Report, signals: Signals) -> Figure:
    """Measured and predicted torque of a recording and their difference, a row per joint."""
    names = report.joint_names
    figure = _blank(_WIDE, 104 * len(names) + 80)
    rows = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
    for j, (axis, name) in enumerate(zip(rows, names)):
        kept = thinned(signals.measured[:, j], _POINTS)
        for label, values, colour, width in (
            ("measured", signals.measured, MEASURED, 1.8),
            ("predicted", signals.predicted, PREDICTED, 1.0),
            ("difference", signals.residual, RESIDUAL, 0.8),
        ):
            axis.plot(signals.time[kept], values[kept, j], color=colour, linewidth=width, label=label)
        axis.set_title(f"{name} [{report.torque_units[j]}]", loc="left", fontsize=9, color=_INK)
        _style(axis)
        axis.locator_params("y", nbins=5)
    rows[-1].set_xlabel("time [s]", **_WORDS)
    return _with_legend(figure, rows[0])


def errors(report: Report) -> Figure:
    """Normalised error of each joint, on what was trained on and on what was held out."""
    figure, names = _blank(_HALF, 330), report.joint_names
    axis = figure.subplots()
    roles = [role for role in ROLES if f"nmse_{role}" in report.errors]
    values = report.errors[[f"nmse_{role}" for role in roles]].clip(lower=1e-12).to_numpy()
    known = np.log10(values[np.isfinite(values)])
    # Ends at whole powers of ten: like bars look alike.
    low, high = (10.0 ** np.floor(known.min()), 10.0 ** np.ceil(known.max())) if len(known) else (0.1, 1.0)
    width = 0.7 / len(roles)
    for k, role in enumerate(roles):
        places = np.arange(len(names)) + (k + 0.5) * width - 0.35
        axis.bar(places, values[:, k] - low, width, bottom=low, color=ROLES[role], label=role)
    axis.set(xlim=(-0.5, len(names) - 0.5), ylim=(low, max(high, 10 * low)))
    canvas.logarithmic(axis)
    axis.set_xticks(range(len(names)), names)
    if len("".join(names)) > _LONG:
        for label in axis.get_xticklabels():
            label.set(rotation=-25, ha="left", rotation_mode="anchor")
    axis.set_ylabel("nMSE")
    _style(axis)
    return _with_legend(figure, axis)


def residual_correlation(report: Report) -> Figure:
    """How residuals are correlated over time, a line per joint, of the longest recording shown."""
    longest = max(shown_recordings(report.signals), key=lambda one: len(one.time))
    step = float(np.nanmedian(np.diff(longest.time)))
    figure = _blank(_WIDE, 360)
    axis = figure.subplots()
    for j, name in enumerate(report.joint_names):
        correlation = autocorrelation(longest.residual[:, j])
        axis.plot(
            np.arange(len(correlation)) * step, correlation, color=_colour(j), linewidth=1.2, label=name
        )
    axis.set(ylim=(-1, 1.05), ylabel="autocorrelation", xlabel=f"lag [s], {longest.name}")
    _style(axis)
    return _with_legend(figure, axis)


def friction(report: Report) -> Figure:
    """Friction over velocity, the identified law over samples of torque less the rigid body's."""
    names, law = report.joint_names, report.friction
    columns = min(4, len(names))
    rows = -(-len(names) // columns)
    figure = _blank(_WIDE, 230 * rows + 40)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(names) :]:
        axis.remove()
    for j, (axis, name) in enumerate(zip(axes, names)):
        if law is not None:
            some = np.linspace(0, len(law.measured) - 1, _CLOUD).astype(int)
            dots = {"color": MEASURED, "markersize": 2.4, "markeredgewidth": 0, "alpha": 0.5}
            axis.plot(law.measured_velocity[some, j], law.measured[some, j], "o", **dots, label="samples")
            axis.plot(law.velocity[j], law.torque[j], color=RESIDUAL, linewidth=1.6, label="identified")
        axis.set_title(f"{name} [{report.torque_units[j]}]", fontsize=9, color=_INK)
        axis.set_xlabel("velocity [rad/s]" if j + columns >= len(names) else "")
        _style(axis)
    return _with_legend(figure, axes[0])


def correlations(report: Report) -> Figure:
    """Correlation of the parameters' errors, (P, P)."""
    figure, names = _blank(660, 560), [str(name) for name in report.parameters.name]
    axis = figure.subplots()
    shown = axis.imshow(
        correlation_of(np.asarray(report.covariance)), "RdBu_r", vmin=-1, vmax=1, interpolation="none"
    )
    bar = figure.colorbar(shown, ax=axis, aspect=40, pad=0.02)
    for shades in bar.ax.collections:
        shades.set_rasterized(True)  # 256 of them
    bar.outline.set_visible(False)
    bar.locator = MaxNLocator(4)
    bar.ax.tick_params(labelsize=9, labelcolor=_INK, color=_LINE)
    places = range(len(names) if len(names) <= _NAMED else 0)
    axis.set_xticks(places, names[: len(places)], rotation=90)
    axis.set_yticks(places, names[: len(places)])
    axis.tick_params(length=0, labelsize=6, labelcolor=_INK)
    axis.spines[:].set_visible(False)
    return figure


def autocorrelation(x: Numbers, lags: int = _LAGS) -> Numbers:
    """Autocorrelation of a signal (S,) at lags 0 … ``lags``; NaN, where lines break, counts as nothing."""
    x = np.nan_to_num(x - np.nanmean(x))
    count = min(lags, len(x) - 1) + 1
    products = np.array([float(x[: len(x) - k] @ x[k:]) for k in range(count)])
    return products / products[0] if products[0] else np.eye(1, count)[0]


def thinned(x: Numbers, most: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Indices of at most ``most`` samples of a signal (S,), the extremes of each stretch among them."""
    if len(x) <= most:
        return np.arange(len(x))
    filled = np.where(np.isnan(x), np.inf, x)  # where a line breaks it goes on breaking
    edges = np.linspace(0, len(x), most // 2 + 1).astype(int)
    extremes = [a + place(filled[a:b]) for a, b in pairwise(edges) for place in (np.argmin, np.argmax)]
    return np.unique(extremes)


def _blank(width: float, height: float) -> Figure:
    """An empty figure of this size [px]."""
    return canvas.blank(width * _PIXEL, height * _PIXEL)


def _colour(joint: int) -> str:
    return _JOINTS[joint % len(_JOINTS)]


def _style(axis: Axes) -> None:
    """The look of a plot of lines or bars: a grid and the line of zero, no frame."""
    axis.grid(color=_GRID, linewidth=0.8)
    axis.set_axisbelow(True)
    axis.tick_params(which="both", length=0, labelsize=9, labelcolor=_INK)
    axis.spines[["left", "right", "top"]].set_visible(False)
    axis.spines["bottom"].set_color(_LINE)
    low, high = axis.get_ylim()
    if low < 0 < high:
        axis.axhline(0, color=_LINE, linewidth=0.8, zorder=0.9)
    axis.margins(x=0)
    for part in (axis.xaxis, axis.yaxis):
        part.label.set(**_WORDS)
        if isinstance(locator := part.get_major_locator(), MaxNLocator):
            locator.set_params(steps=_STEPS)


def _with_legend(figure: Figure, axis: Axes) -> Figure:
    """The figure with the names of what is drawn on one of its axes above all."""
    handles, labels = axis.get_legend_handles_labels()
    canvas.legend(figure, dict(zip(labels, handles)), "outside upper left")
    return figure
