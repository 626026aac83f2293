"""The pictures of ``motion`` with plotly: to turn, to zoom, to play."""

from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.report.pose import Film, Mesh, Scene
from sidegan.report.style import DESK, PALETTE, PATH

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go

_AXIS = {"backgroundcolor": "rgba(0, 0, 0, 0)", "gridcolor": "rgba(128, 128, 128, 0.35)", "zeroline": False}
_LEGEND = {
    "orientation": "h",
    "yref": "container",
    "y": 0.005,
    "yanchor": "bottom",
    "x": 0.5,
    "xanchor": "center",
}
_MILLIMETRE = 3  # digits of a metre that a drawing needs


def paths(scene: Scene) -> "go.Figure":
    """All paths in one space, bundles to show and hide by the legend: the first and the last are shown."""
    drawn = []
    for k, (bundle, some) in enumerate(zip(scene.bundles, scene.paths)):
        shade, width = bundle.colour or PALETTE[k % len(PALETTE)], 4 if len(some) == 1 else 1.5
        path = _path(np.concatenate(some), bundle.title.replace("\n", ", "), shade, width)
        shown = bundle.colour is None or k in (0, len(scene.bundles) - 1)
        drawn.append(path | {"visible": True if shown else "legendonly"})
    return _space(drawn, scene.limits, scene.desk)


def snapshots(film: Film) -> "go.Figure":
    """The arm's capsules and the path; a slider moves the arm along it."""
    drawn = [_path(film.path, "end effector", PATH, 3)]
    drawn += [_surface(mesh) | {"visible": k == 0} for k, mesh in enumerate(film.meshes)]
    figure = _space(drawn, film.limits, film.desk)
    steps = []
    for k, time in enumerate(film.times):
        shown = [True, *(i == k for i in range(len(film.times))), *([] if film.desk is None else [True])]
        steps.append({"label": f"{time:.1f} s", "method": "restyle", "args": ["visible", shown]})
    slider = {"steps": steps, "x": 0.08, "len": 0.84, "y": 0.02, "currentvalue": {"visible": False}}
    figure.update_layout(sliders=[slider], margin_b=80)
    return figure


def _path(path: np.ndarray, name: str, shade: str, width: float) -> dict[str, Any]:
    places = dict(zip("xyz", path.T.round(_MILLIMETRE).astype(np.float32)))
    return {
        "type": "scatter3d",
        **places,
        "mode": "lines",
        "name": name,
        "line": {"color": shade, "width": width},
    }


def _surface(mesh: Mesh) -> dict[str, Any]:
    triangles = np.concatenate([mesh.faces[:, [0, 1, 2]], mesh.faces[:, [0, 2, 3]]]).T.astype(np.int32)
    shape = dict(zip("xyzijk", [*mesh.vertices.T.astype(np.float32), *triangles]))
    light = {"ambient": 0.55, "diffuse": 0.7, "specular": 0.2}
    look = {"color": "#5b8db8", "lighting": light, "hoverinfo": "skip", "showlegend": False}
    return {"type": "mesh3d", **shape, **look}


def _space(drawn: list[dict[str, Any]], limits: np.ndarray, desk: float | None) -> "go.Figure":
    """Traces in one space of equal scale [m], the desk behind them, drawn for any background."""
    import plotly.graph_objects as go

    figure = go.Figure(drawn)
    if desk is not None:
        (x, y, _), (right, back, _) = limits
        plane = {"x": [x, right, right, x], "y": [y, y, back, back], "z": [desk] * 4}
        corners = {"i": [0, 0], "j": [1, 2], "k": [2, 3]}
        figure.add_mesh3d(**plane, **corners, color=DESK, opacity=0.3, hoverinfo="skip", showlegend=False)
    axes = {
        f"{name}axis": {"title": f"{name} [m]", "range": limits[:, k].tolist(), **_AXIS}
        for k, name in enumerate("xyz")
    }
    camera = {"eye": {"x": 1.2, "y": -1.55, "z": 0.75}, "center": {"x": 0, "y": 0, "z": -0.16}}
    return figure.update_layout(
        template="none",
        height=560,
        margin={"l": 0, "r": 0, "t": 10, "b": 40},
        paper_bgcolor="rgba(0, 0, 0, 0)",
        font={"size": 12, "color": "#57606a"},
        legend=_LEGEND,
        hoverlabel={"namelength": -1},
        scene={"aspectmode": "data", "camera": camera, **axes},
    )
