"""The figures of ``motion`` once more, with plotly: to turn, to zoom, to play."""

from typing import TYPE_CHECKING, Any

import numpy as np
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.report.motion import Bundles, describe
from sidegan.report.plotted import finish
from sidegan.report.pose import Mesh, bounds, film, tip_traces
from sidegan.report.style import DESK, colour
from sidegan.report.tables import title
from sidegan.robot import Arm

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go

_SHADES = ("#1f77b4", "#d95f02", "#1b9e77", "#a6559d", "#b08a00", "#b2182b", "#7f7f7f", "#4d9221")
_AXIS = {"backgroundcolor": "rgba(0, 0, 0, 0)", "gridcolor": "rgba(128, 128, 128, 0.35)", "zeroline": False}
_MILLIMETRE = 3  # digits of a metre that a drawing needs


def traces(arm: Arm, family: Trajectory, coefficients: Tensor, desk: float | None = 0.0) -> "go.Figure":
    """The end effector's paths in one space, one at a time or all; see ``motion.traces``."""
    paths = tip_traces(arm, family, coefficients)
    drawn = [
        _path(path, f"trajectory {k + 1}", _SHADES[k % len(_SHADES)], width=4) for k, path in enumerate(paths)
    ]
    return _space(drawn, bounds([paths], desk), desk)


def stacked(arm: Arm, bundles: Bundles, desk: float | None = 0.0) -> "go.Figure":
    """All paths of each set in one space, sets to show and hide by the legend; see ``motion.stacked``."""
    if not bundles:
        raise ShapeError("there are no sets to draw")
    paths = {name: tip_traces(arm, family, c) for name, (family, c) in bundles.items()}
    drawn = []
    for k, (name, set_) in enumerate(paths.items()):
        words = f"{title(name)}, {describe(bundles[name][0], len(set_))}"
        path = _path(np.concatenate(set_), words, colour(name), width=1.5)  # all begin and end at home
        drawn.append(path.update(visible=True if k in (0, len(paths) - 1) else "legendonly"))
    return _space(drawn, bounds(list(paths.values()), desk), desk)


def snapshots(
    arm: Arm, family: Trajectory, coefficients: Tensor, count: int = 6, desk: float | None = 0.0
) -> "go.Figure":
    """The arm's capsules, a slider moves it along the trajectory; see ``motion.snapshots``."""
    scene = film(arm, family, coefficients, count)
    drawn = [_path(scene.path, "end effector", "#b2182b", width=3)]
    drawn += [_surface(mesh).update(visible=k == 0) for k, mesh in enumerate(scene.meshes)]
    figure = _space(drawn, bounds([scene.path, *(mesh.vertices for mesh in scene.meshes)], desk), desk)
    steps = []
    for k, time in enumerate(scene.times):
        shown = [True, *(i == k for i in range(count)), *([] if desk is None else [True])]
        steps.append({"label": f"{time:.1f} s", "method": "restyle", "args": ["visible", shown]})
    slider = {"steps": steps, "x": 0.08, "len": 0.84, "y": 0.02, "currentvalue": {"visible": False}}
    figure.update_layout(sliders=[slider], margin_b=80)
    return figure


def _path(path: np.ndarray, name: str, shade: str, width: float) -> Any:
    import plotly.graph_objects as go

    x, y, z = path.T.round(_MILLIMETRE).astype(np.float32)
    return go.Scatter3d(x=x, y=y, z=z, mode="lines", name=name, line={"color": shade, "width": width})


def _surface(mesh: Mesh) -> Any:
    import plotly.graph_objects as go

    x, y, z = mesh.vertices.T.astype(np.float32)
    i, j, k = np.concatenate([mesh.faces[:, [0, 1, 2]], mesh.faces[:, [0, 2, 3]]]).T.astype(np.int32)
    light = {"ambient": 0.55, "diffuse": 0.7, "specular": 0.2}
    shape = {"x": x, "y": y, "z": z, "i": i, "j": j, "k": k}
    return go.Mesh3d(**shape, color="#5b8db8", lighting=light, hoverinfo="skip", showlegend=False)


def _space(drawn: list[Any], limits: np.ndarray, desk: float | None) -> "go.Figure":
    """Traces in one space of equal scale [m], the desk behind them."""
    import plotly.graph_objects as go

    figure = go.Figure(drawn)
    if desk is not None:
        (x, y, _), (right, back, _) = limits
        plane = {"x": [x, right, right, x], "y": [y, y, back, back], "z": [desk] * 4}
        corners = {"i": [0, 0], "j": [1, 2], "k": [2, 3]}
        figure.add_mesh3d(**plane, **corners, color=DESK, opacity=0.3, hoverinfo="skip", showlegend=False)
    finish(figure, 560)
    axes = {
        f"{name}axis": {"title": f"{name} [m]", "range": limits[:, k].tolist(), **_AXIS}
        for k, name in enumerate("xyz")
    }
    camera = {"eye": {"x": 1.2, "y": -1.55, "z": 0.75}, "center": {"x": 0, "y": 0, "z": -0.16}}
    figure.update_layout(scene={"aspectmode": "data", "camera": camera, **axes})
    figure.update_layout(margin={"l": 0, "r": 0, "t": 10, "b": 40})
    return figure
