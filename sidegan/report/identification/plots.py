"""Plots of an identification, for its report."""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy  # its parts are imported when they are used
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sidegan.identification.identified import IdentifiedArm
from sidegan.identification.measurements import SAMPLES_AT_ONCE
from sidegan.recording.tables import Numbers
from sidegan.report import canvas

MEASURED, PREDICTED, RESIDUAL = "#8795a1", "#0b66c3", "#d9480f"
_ROLES = {"nMSE, training": "#8795a1", "nMSE, validation": "#0b66c3"}
_JOINTS = ("#0b66c3", "#d9480f", "#1a7f4b", "#8e44ad", "#b26a00", "#0f8b8d", "#c2185b", "#5b6b7b")
_PIXEL = 1 / 96  # [inch]
_WIDE, _HALF = 1080, 560  # [px] of a section and of half of it
_POINTS = 1200  # of a line: as many as a screen can show
_CURVE, _CLOUD = 101, 300  # points of a friction curve, and samples beside it
_RECORDINGS = 12  # that are shown
_LAGS = 60  # samples over which residuals are correlated
_NAMED = 60  # parameters up to which a correlation has its names beside it
_LONG = 60  # letters of names that have no room beside each other


class Predicted(NamedTuple):
    """Torques of one recording [N·m or N]; a row of NaN breaks the line."""

    name: str  # of the recording
    role: str  # of the recording
    time: Numbers  # [s], (S,)
    measured: Numbers  # (S, J)
    predicted: Numbers  # of the same states by the model to use, (S, J)


def predicted(identified: IdentifiedArm) -> list[Predicted]:
    """Torques of the recordings that are shown, those of the validation first."""
    model, theta, found = identified.model, identified.used.parameters, []
    for recording in [*identified.validation, *identified.training][:_RECORDINGS]:
        parts = []
        for segment in recording.segments:
            pieces = zip(*(x.split(SAMPLES_AT_ONCE) for x in (*segment[1:4], segment.sign)))
            torque = torch.cat([model.torque(theta, *piece) for piece in pieces])
            parts.append(torch.cat([segment.time[:, None], segment.torque, torque], 1))
            parts.append(torch.full_like(parts[-1][:1], torch.nan))
            parts[-1][0, 0] = segment.time[-1]
        time, *torques = torch.cat(parts[:-1]).split([1, model.joints, model.joints], 1)
        found.append(Predicted(recording.name, recording.role, *(x.numpy() for x in (time[:, 0], *torques))))
    return found


def torques(identified: IdentifiedArm, shown: Predicted) -> Figure:
    """Measured and predicted torque of a recording and their difference, a row per joint."""
    titles = _titles(identified)
    figure = _blank(_WIDE, 104 * len(titles) + 80)
    rows = figure.subplots(len(titles), sharex=True, squeeze=False)[:, 0]
    for j, (axis, title) in enumerate(zip(rows, titles)):
        kept = thinned(shown.measured[:, j], _POINTS)
        for label, values, colour, width in (
            ("measured", shown.measured, MEASURED, 1.8),
            ("predicted", shown.predicted, PREDICTED, 1.0),
            ("difference", shown.measured - shown.predicted, RESIDUAL, 0.8),
        ):
            axis.plot(shown.time[kept], values[kept, j], color=colour, linewidth=width, label=label)
        axis.set_title(title, loc="left", fontsize=9)
        axis.locator_params("y", nbins=5)
        axis.set_xlabel("time [s]" if j + 1 == len(titles) else "")
        _style(axis)
    return _with_legend(figure, rows[0])


def errors(table: pd.DataFrame) -> Figure:
    """Normalised error of each joint, of ``content.error_table``."""
    figure, nmse = _blank(_HALF, 330), table.filter(like="nMSE").clip(lower=1e-12)
    axis, known = figure.subplots(), np.log10(nmse.to_numpy()[np.isfinite(nmse)])
    # Ends at whole powers of ten: like bars look alike.
    low, high = (10.0 ** np.floor(known.min()), 10.0 ** np.ceil(known.max())) if len(known) else (0.1, 1.0)
    bars = nmse.rename(columns=lambda name: name.removeprefix("nMSE, "))
    bars.plot.bar(ax=axis, color=[_ROLES[str(name)] for name in nmse], width=0.7, rot=0, legend=False)
    axis.set(yscale="log", ylim=(low, max(high, 10 * low)), ylabel="nMSE")
    canvas.logarithmic(axis)
    if len("".join(nmse.index)) > _LONG:
        for label in axis.get_xticklabels():
            label.set(rotation=-25, ha="left", rotation_mode="anchor")
    _style(axis)
    return _with_legend(figure, axis)


def residual_correlation(identified: IdentifiedArm, shown: list[Predicted]) -> Figure:
    """Correlation of residuals over time, a line per joint, of the longest recording shown."""
    longest = max(shown, key=lambda one: len(one.time))
    step = float(np.nanmedian(np.diff(longest.time)))
    figure = _blank(_WIDE, 360)
    axis = figure.subplots()
    for j, name in enumerate(identified.model.arm.joint_names):
        y = autocorrelation(longest.measured[:, j] - longest.predicted[:, j])
        colour = _JOINTS[j % len(_JOINTS)]
        axis.plot(np.arange(len(y)) * step, y, color=colour, linewidth=1.2, label=name)
    axis.set(ylim=(-1, 1.05), ylabel="autocorrelation", xlabel=f"lag [s], {longest.name}")
    _style(axis)
    return _with_legend(figure, axis)


def friction(identified: IdentifiedArm) -> Figure:
    """Friction over velocity, the identified law over samples of torque less the rigid body's."""
    model, theta, titles = identified.model, identified.used.parameters, _titles(identified)
    columns = min(4, len(titles))
    rows = -(-len(titles) // columns)
    figure = _blank(_WIDE, 230 * rows + 40)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(titles) :]:
        axis.remove()
    segments = [segment[1:5] for recording in identified.training for segment in recording.segments]
    q, dq, ddq, torque = (torch.cat(x) for x in zip(*segments))
    some = np.linspace(0, len(q) - 1, _CLOUD).astype(int)
    q, dq, ddq, torque = q[some], dq[some], ddq[some], torque[some]

    def law(velocity: torch.Tensor) -> torch.Tensor:
        """Friction and offset [N·m or N], (S, J)."""
        still = torch.zeros_like(velocity)
        return model.regressor(still, velocity, still)[..., model.rigid :] @ theta[model.rigid :]

    rest = torque - model.torque(theta, q, dq, ddq) + law(dq)
    velocity = torch.linspace(-1, 1, _CURVE, dtype=torch.float64)[:, None] * dq.abs().amax(0)
    curve, dots = law(velocity), {"color": MEASURED, "markersize": 2.4, "markeredgewidth": 0, "alpha": 0.5}
    for j, (axis, title) in enumerate(zip(axes, titles)):
        axis.plot(dq[:, j], rest[:, j], "o", **dots, label="samples")
        axis.plot(velocity[:, j], curve[:, j], color=RESIDUAL, linewidth=1.6, label="identified")
        axis.set_title(title, fontsize=9)
        axis.set_xlabel("velocity [rad/s]" if j + columns >= len(titles) else "")
        _style(axis)
    return _with_legend(figure, axes[0])


def correlations(correlation: Numbers, names: list[str]) -> Figure:
    """Correlation of the parameters' errors, (P, P)."""
    figure = _blank(660, 560)
    axis = figure.subplots()
    shown = axis.imshow(correlation, "RdBu_r", vmin=-1, vmax=1, interpolation="none")
    bar = figure.colorbar(shown, ax=axis, aspect=40, pad=0.02)
    for shades in bar.ax.collections:
        shades.set_rasterized(True)  # 256 of them
    bar.outline.set_visible(False)
    bar.locator = MaxNLocator(4)
    bar.ax.tick_params(labelsize=9)
    places = range(len(names) if len(names) <= _NAMED else 0)
    axis.set_xticks(places, names[: len(places)], rotation=90)
    axis.set_yticks(places, names[: len(places)])
    axis.tick_params(length=0, labelsize=6)
    axis.spines[:].set_visible(False)
    return figure


def autocorrelation(x: Numbers, lags: int = _LAGS) -> Numbers:
    """Autocorrelation of a signal (S,) at lags 0 … ``lags``; NaN, where lines break, counts as nothing."""
    x = np.nan_to_num(x - np.nanmean(x))
    products = scipy.signal.correlate(x, x)[len(x) - 1 :][: lags + 1]
    return products / products[0] if products[0] else np.eye(1, len(products))[0]


def thinned(x: Numbers, most: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Indices of at most ``most`` samples of a signal (S,), the extremes of each stretch among them."""
    if len(x) <= most:
        return np.arange(len(x))
    filled = np.where(np.isnan(x), np.inf, x)  # where a line breaks it goes on breaking
    edges = np.linspace(0, len(x), most // 2 + 1).astype(int)
    extremes = [a + place(filled[a:b]) for a, b in pairwise(edges) for place in (np.argmin, np.argmax)]
    return np.unique(extremes)


def _titles(identified: IdentifiedArm) -> list[str]:
    """Joints with the units of their torques."""
    arm = identified.model.arm
    units = ["N" if slides else "N·m" for slides in arm.prismatic.tolist()]
    return [f"{name} [{unit}]" for name, unit in zip(arm.joint_names, units)]


def _blank(width: float, height: float) -> Figure:
    """An empty figure of this size [px]."""
    return canvas.blank(width * _PIXEL, height * _PIXEL)


def _style(axis: Axes) -> None:
    """The look of a plot of lines or bars."""
    canvas.tidy(axis)
    axis.margins(x=0)
    for part in (axis.xaxis, axis.yaxis):
        part.label.set_fontsize(9)


def _with_legend(figure: Figure, axis: Axes) -> Figure:
    """The figure with the names of what is drawn on one of its axes above all."""
    handles, labels = axis.get_legend_handles_labels()
    canvas.legend(figure, dict(zip(labels, handles)), "outside upper left")
    return figure
