"""Paths of the end effector in space, with matplotlib.

Source: Jegorova et al. 2020, figure 2.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from sidegan.base.arrays import Array
from sidegan.motion.trajectory import Trajectory
from sidegan.report.canvas import letter
from sidegan.report.style import DESK
from sidegan.robot import Arm
from sidegan.robot.visuals import capsule_surface
from sidegan.validity.capsules import place_points

_RATE = 25.0  # sampling rate of a path [Hz]
_ROOM = 0.02  # least margin around the paths [m]
_COLUMNS = 4
_TIME, _AHEAD, _BONES = "viridis", "#c8ccd0", "#c3cad1"
_VIEW = {"elev": 22.0, "azim": -58.0}
_SPACE: dict[str, Any] = {"projection": "3d", "computed_zorder": False}
_WIDTH, _HEIGHT = 2.9, 2.5  # [inch] of a panel
_POSE = 1.6, 1.65  # [inch] of a panel with a pose
_DESK = 0.55  # size of the desk in a panel with a pose, as a share of the limits


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
    letter(figure.axes)
    return figure


def poses(arm: Arm, family: Trajectory, coefficients: Array, count: int) -> Figure:
    """The arm's capsules at ``count`` times along trajectories (B, J, H, 2), a row each.

    The end effector's path is grey where it has not been yet.
    """
    tips = tip_paths(arm, family, coefficients)
    batch, steps, _ = tips.shape
    samples = np.linspace(0, steps - 1, count, endpoint=False).round().astype(int)
    times = family.times(_RATE)[samples]
    q = family.roll_out(coefficients, times).position.reshape(-1, arm.joints)
    triangles = surfaces(arm, q)
    limits = bounds([tips, triangles])
    figure = Figure(figsize=(count * _POSE[0], batch * _POSE[1]))
    figure.subplots_adjust(0.0, 0.0, 1.0, 1 - 0.2 / figure.get_figheight(), 0.0, 0.0)
    axes = figure.subplots(batch, count, squeeze=False, subplot_kw=_SPACE)
    for axis, (row, k), faces in zip(axes.ravel(), product(tips, samples), triangles):
        _frame(axis, limits, _DESK * limits, zoom=1.5)
        axis.set_axis_off()
        axis.plot(*row[k:].T, color=_AHEAD, lw=1, zorder=2)
        _timed(axis, row, k)
        shown = Poly3DCollection(faces, facecolors=_BONES, shade=True, zorder=5)
        axis.add_collection3d(shown, autolim=False)
    for axis, time in zip(axes[0], times):
        axis.set_title(f"{time:.3g} s", fontsize=9)
    letter(axes[:, 0])
    return figure


def surfaces(arm: Arm, q: Array) -> Array:
    """Triangles [m], (N, F, 3, 3), of the arm's capsules at positions (N, J) [rad or m]."""
    capsules, parts = arm.capsules, []
    radii = np.maximum(capsules.radius, _ROOM)  # a link without shapes has points of radius 0
    for link, a, b, radius in zip(capsules.link, capsules.a, capsules.b, radii.tolist()):
        vertices, faces = capsule_surface(a, b, radius)
        parts.append(place_points(arm, q.T, vertices, np.full(len(vertices), link)).T[:, faces])
    return np.concatenate(parts, 1)


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


def _timed(axis: Axes3D, path: Array, end: int | None = None) -> None:
    """Draw a path up to a sample, coloured by time."""
    shades = colormaps[_TIME](np.linspace(0, 0.92, len(path) - 1))
    pieces = np.stack([path[:-1], path[1:]], 1)[:end]
    lines = Line3DCollection(pieces, colors=shades[:end], linewidths=1.3, zorder=3)
    axis.add_collection3d(lines, autolim=False)
    axis.plot(*path[:1].T, "o", color="black", markersize=3, zorder=4)


def _frame(axis: Axes3D, limits: Array, desk: Array, zoom: float) -> None:
    """Set limits [m] at equal scales, and draw the desk between corners [m]."""
    (x, y, _), (right, back, _) = desk
    corners = [[(x, y, 0.0), (right, y, 0.0), (right, back, 0.0), (x, back, 0.0)]]
    axis.view_init(**_VIEW)
    axis.set(xlim=limits[:, 0], ylim=limits[:, 1], zlim=limits[:, 2])
    axis.set_box_aspect(limits[1] - limits[0], zoom=zoom)
    axis.add_collection3d(Poly3DCollection(corners, facecolors=DESK, alpha=0.25, zorder=1), autolim=False)


def _panels(figure: Figure, titles: Sequence[str], limits: Array) -> Iterator[Axes3D]:
    """Three-dimensional panels with equal scales within limits [m], and the desk."""
    # Automatic layout ignores the labels of 3D axes.
    rows = -(-len(titles) // _COLUMNS)
    columns = -(-len(titles) // rows)
    figure.set_size_inches(columns * _WIDTH + 0.3, rows * _HEIGHT + 0.2)
    above, right = 0.36 / (rows * _HEIGHT), 0.5 / (columns * _WIDTH)
    figure.subplots_adjust(0.01, 0.2 / rows, 1 - right, 1 - above, wspace=0.0, hspace=0.26)
    for k, title in enumerate(titles):
        axis: Axes3D = figure.add_subplot(rows, columns, k + 1, **_SPACE)
        _frame(axis, limits, limits, zoom=1.05)
        axis.set_title(title, fontsize=9)
        ticks = np.ceil(4 * np.ptp(limits, 0) / np.ptp(limits, 0).max())
        for part, name, most in zip((axis.xaxis, axis.yaxis, axis.zaxis), "xyz", ticks.tolist()):
            part.set_major_locator(MaxNLocator(most))
            part.set_pane_color((1, 1, 1, 0))
            part.set_tick_params(labelsize=6, pad=-3)
            part.set_label_text(f"{name} [m]", fontsize=7)
            part.labelpad = -8
        yield axis
