"""Pictures of motion in space, with matplotlib: paths of the end effector, the arm on its way.

Source: Jegorova et al. 2020, figure 2.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LightSource
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from sidegan.report.pose import Film, Mesh, Scene
from sidegan.report.style import DESK, PATH

_COLUMNS = 4
_TIME = "viridis"
_VIEW = {"elev": 22.0, "azim": -58.0}
_LIGHT = LightSource(azdeg=-58, altdeg=50)
_FADING = 0.16  # opacity that is left of a pose at the next one
_FLAT = 0.93  # height of a panel over its width


def paths(scene: Scene) -> Figure:
    """A panel per bundle with the paths of its trajectories, all to one scale."""
    figure = Figure()
    panels = _panels(figure, 2.9, [bundle.title for bundle in scene.bundles], _COLUMNS, scene)
    for axis, bundle, some in zip(panels, scene.bundles, scene.paths):
        if bundle.colour is None:
            for path in some:
                _timed(axis, path)
        else:
            lines = Line3DCollection(list(some), colors=bundle.colour, linewidths=0.5, alpha=0.75)
            axis.add_collection3d(lines, autolim=False)
    return figure


def snapshots(film: Film) -> Figure:
    """The arm's capsules at instants of one trajectory, those before fading behind, with the path so far."""
    figure, count = Figure(), len(film.times)
    shades = colormaps[_TIME](np.linspace(0.1, 0.8, count))[:, :3]
    panels = _panels(figure, 3.0, [f"{time:.1f} s" for time in film.times], _COLUMNS - 1, film)
    for k, axis in enumerate(panels):
        visible = [(film.meshes[i], shades[i], _FADING ** (k - i)) for i in range(max(0, k - 2), k + 1)]
        axis.add_collection3d(_surfaces(visible), autolim=False)
        so_far = film.path[: 1 + round(len(film.path) * film.times[k] / film.period)]
        axis.plot(*so_far.T, color=PATH, linewidth=1.0, zorder=3)
    return figure


def _surfaces(visible: Sequence[tuple[Mesh, np.ndarray, float]]) -> Poly3DCollection:
    """Arms (mesh, colour, opacity) as one collection, which sorts all their faces by depth."""
    faces = np.concatenate([mesh.vertices[mesh.faces] for mesh, _, _ in visible])
    paints = [np.tile([*shade, opacity], (len(mesh.faces), 1)) for mesh, shade, opacity in visible]
    return Poly3DCollection(
        faces, facecolors=np.concatenate(paints), shade=True, lightsource=_LIGHT, linewidths=0, zorder=2
    )


def _timed(axis: Axes3D, path: np.ndarray) -> None:
    """A path whose colour tells the time."""
    shades = colormaps[_TIME](np.linspace(0, 0.92, len(path) - 1))
    pieces = np.stack([path[:-1], path[1:]], 1)
    axis.add_collection3d(Line3DCollection(pieces, colors=shades, linewidths=1.3, zorder=3), autolim=False)
    axis.plot(*path[:1].T, "o", color="black", markersize=3, zorder=4)


def _panels(
    figure: Figure, size: float, titles: Sequence[str], most: int, shown: Scene | Film
) -> Iterator[Axes3D]:
    """Square panels of this size [inch] in space, axes of equal scale [m], the desk drawn."""
    # Without automatic layout, which knows nothing of the labels of axes in space.
    columns = min(most, len(titles))
    rows = -(-len(titles) // columns)
    FigureCanvasAgg(figure)
    figure.set_size_inches(columns * size + 0.3, rows * size * _FLAT + 0.2)
    above, right = 0.36 / (rows * size * _FLAT), 0.5 / (columns * size)
    figure.subplots_adjust(0.01, 0.12 / rows, 1 - right, 1 - above, wspace=0.14, hspace=0.24)
    limits = shown.limits
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
