"""Paths of the end effector in space, with matplotlib.

Source: Jegorova et al. 2020, figure 2.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from sidegan.base.arrays import Array
from sidegan.motion.trajectory import Trajectory
from sidegan.report.style import DESK
from sidegan.robot import Arm
from sidegan.validity.capsules import place_points

_RATE = 25.0  # sampling rate of a path [Hz]
_ROOM = 0.02  # least margin around the paths [m]
_COLUMNS = 4
_TIME, _BONES = "viridis", "#8a8f98"
_VIEW = {"elev": 22.0, "azim": -58.0}
_WIDTH, _HEIGHT = 2.9, 2.697  # [inch] of a panel


class Bundle(NamedTuple):
    """Trajectories whose paths share a panel."""

    title: str
    family: Trajectory
    coefficients: Array  # [rad/s], (B, J, H, 2)
    colour: str | None = None  # of the paths; None: coloured by time


def paths(arm: Arm, bundles: Sequence[Bundle]) -> Figure:
    """The end effector's paths, a panel per bundle, to a common scale."""
    drawn = [tip_paths(arm, bundle.family, bundle.coefficients) for bundle in bundles]
    figure = Figure()
    panels = _panels(figure, [bundle.title for bundle in bundles], bounds(drawn))
    for axis, bundle, tips in zip(panels, bundles, drawn):
        if bundle.colour is None:
            for path in tips:
                _timed(axis, path)
        else:
            lines = Line3DCollection(list(tips), colors=bundle.colour, linewidths=0.5, alpha=0.75)
            axis.add_collection3d(lines, autolim=False)
    return figure


def poses(arm: Arm, family: Trajectory, coefficients: Array, count: int) -> Figure:
    """The arm at ``count`` times along a trajectory (J, H, 2), a panel each with its end effector's path."""
    (path,) = tip_paths(arm, family, coefficients[None])
    samples = np.linspace(0, len(path) - 1, count, endpoint=False).round().astype(int)
    motion = family.roll_out(coefficients[None], family.times(_RATE))
    q = motion.position[0, samples].T
    origins = np.concatenate([np.zeros((arm.joints, 3)), arm.tip[None]])
    links = np.append(np.arange(arm.joints), arm.joints - 1)
    joints = place_points(arm, q, origins, links).transpose(2, 1, 0)  # (count, J + 1, 3)
    joints = np.concatenate([np.zeros((count, 1, 3)), joints], 1)  # from the base
    figure = Figure()
    titles = [f"{float(motion.time[k]):.3g} s" for k in samples]
    for axis, k, bones in zip(_panels(figure, titles, bounds([path, joints])), samples, joints):
        _timed(axis, path)
        axis.plot(*bones.T, "-", color=_BONES, lw=4, solid_capstyle="round", zorder=5)
        axis.plot(*bones.T, "o", color="black", markersize=2.5, zorder=6)
        axis.plot(*path[k : k + 1].T, "o", color=DESK, markeredgecolor="black", markersize=4, zorder=7)
    return figure


def tip_paths(arm: Arm, family: Trajectory, coefficients: Array) -> Array:
    """End effector's positions [m], (B, T, 3), over one period."""
    motion = family.roll_out(coefficients, family.times(_RATE))
    batch, count, joints = motion.position.shape
    q = motion.position.reshape(-1, joints).T
    tips = place_points(arm, q, arm.tip[None], np.array([joints - 1]))[:, 0]
    return tips.T.reshape(batch, count, 3)


def bounds(points: Sequence[Array]) -> Array:
    """Corners [m], (2, 3), of a box around all points (…, 3) and the arm's base."""
    flat = np.concatenate([np.zeros((1, 3)), *(x.reshape(-1, 3) for x in points)])
    low = flat.min(0)
    high = flat.max(0)
    room = np.maximum(0.04 * (high - low).max(), _ROOM)
    low = low - room
    high = high + room
    if low[2] > -2 * room:
        low[2] = 0.0  # hardly anything is below the desk: make it the floor
    return np.stack([low, high])


def _timed(axis: Axes3D, path: Array) -> None:
    """Draw a path coloured by time."""
    shades = colormaps[_TIME](np.linspace(0, 0.92, len(path) - 1))
    pieces = np.stack([path[:-1], path[1:]], 1)
    axis.add_collection3d(Line3DCollection(pieces, colors=shades, linewidths=1.3, zorder=3), autolim=False)
    axis.plot(*path[:1].T, "o", color="black", markersize=3, zorder=4)


def _panels(figure: Figure, titles: Sequence[str], limits: Array) -> Iterator[Axes3D]:
    """Three-dimensional panels with equal scales within limits [m], and the desk."""
    # Automatic layout ignores the labels of 3D axes.
    rows = -(-len(titles) // _COLUMNS)
    columns = -(-len(titles) // rows)
    figure.set_size_inches(columns * _WIDTH + 0.3, rows * _HEIGHT + 0.2)
    above, right = 0.36 / (rows * _HEIGHT), 0.5 / (columns * _WIDTH)
    figure.subplots_adjust(0.01, 0.12 / rows, 1 - right, 1 - above, wspace=0.14, hspace=0.24)
    (x, y, _), (right, back, _) = limits
    desk = [[(x, y, 0.0), (right, y, 0.0), (right, back, 0.0), (x, back, 0.0)]]
    for k, title in enumerate(titles):
        axis: Axes3D = figure.add_subplot(rows, columns, k + 1, projection="3d", computed_zorder=False)
        axis.view_init(**_VIEW)
        axis.set(xlim=limits[:, 0], ylim=limits[:, 1], zlim=limits[:, 2])
        axis.set_title(title, fontsize=9)
        axis.set_box_aspect(limits[1] - limits[0], zoom=1.16)
        axis.add_collection3d(Poly3DCollection(desk, facecolors=DESK, alpha=0.25, zorder=1), autolim=False)
        for part, name in zip((axis.xaxis, axis.yaxis, axis.zaxis), "xyz"):
            part.set_major_locator(MaxNLocator(4))
            part.set_pane_color((1, 1, 1, 0))
            part.set_tick_params(labelsize=6, pad=-3)
            part.set_label_text(f"{name} [m]", fontsize=7)
            part.labelpad = -9
        yield axis
