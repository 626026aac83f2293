"""Interactive plots of an identification."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from sidegan.report.identification.content import Friction, Numbers, Report, Signals, correlation_of

MEASURED, PREDICTED, RESIDUAL = "#8795a1", "#0b66c3", "#d9480f"
ROLES = {"training": "#8795a1", "validation": "#0b66c3"}
_JOINTS = ("#0b66c3", "#d9480f", "#1a7f4b", "#8e44ad", "#b26a00", "#0f8b8d", "#c2185b", "#5b6b7b")
_POINTS = 1200  # of a line: as many as a screen can show
_CLOUD = 500  # samples of a friction curve
_RECORDINGS = 12  # that can be chosen among
_LAGS = 60  # samples over which residuals are correlated
_NAMED = 60  # parameters up to which a correlation has its names beside it
_GRID = "#e6ebef"


def torques(report: Report) -> go.Figure:
    """Measured and predicted torque and their difference, a row per joint, a recording at a time."""
    names = list(report.joint_names)
    figure = make_subplots(rows=len(names), cols=1, shared_xaxes=True, vertical_spacing=0.24 / len(names))
    shown = shown_recordings(report.signals)
    for k, signals in enumerate(shown):
        for j in range(len(names)):
            for trace in _lines(signals, j, visible=k == 0, legend=j == 0):
                figure.add_trace(trace, row=j + 1, col=1)
    per = 3 * len(names)
    buttons = [
        {
            "label": f"{signals.name} ({signals.role})",
            "method": "update",
            "args": [{"visible": [i // per == k for i in range(per * len(shown))]}],
        }
        for k, signals in enumerate(shown)
    ]
    corner = {"x": 0, "xref": "x domain", "xanchor": "left", "y": 1, "yref": "y domain", "yanchor": "bottom"}
    for j, name in enumerate(names):
        figure.add_annotation(
            text=f"{name} [{report.torque_units[j]}]", showarrow=False, **corner, row=j + 1, col=1
        )
    figure.update_xaxes(title_text="time [s]", row=len(names), col=1)
    menus = [{"buttons": buttons, "x": 0, "xanchor": "left", "y": 1, "yanchor": "bottom", "pad": {"b": 22}}]
    _style(figure, 104 * len(names) + 160, top=90)
    return figure.update_layout(updatemenus=menus, hovermode="x unified")


def shown_recordings(signals: Sequence[Signals]) -> list[Signals]:
    """The recordings that the report shows, those of the validation first."""
    return sorted(signals, key=lambda one: one.role != "validation")[:_RECORDINGS]


def errors(report: Report) -> go.Figure:
    """Normalised error of each joint, on what was trained on and on what was held out."""
    figure = go.Figure()
    columns = {role: column for role in ROLES if (column := f"nmse_{role}") in report.errors}
    for role, column in columns.items():
        values = report.errors[column]
        figure.add_bar(x=list(report.joint_names), y=values, name=role, marker_color=ROLES[role])
    powers = np.log10(report.errors[[*columns.values()]].clip(lower=1e-12).to_numpy())
    known = powers[np.isfinite(powers)]
    whole = [np.floor(known.min()), np.ceil(known.max())] if len(known) else None  # like bars look alike
    figure.update_yaxes(type="log", title_text="nMSE", exponentformat="power", range=whole)
    figure.update_layout(showlegend=True)
    return _style(figure, 330)


def residual_correlation(report: Report) -> go.Figure:
    """How residuals are correlated over time, a line per joint, of the longest recording shown."""
    longest = max(shown_recordings(report.signals), key=lambda one: len(one.time))
    step = float(np.nanmedian(np.diff(longest.time)))
    figure = go.Figure()
    for j, name in enumerate(report.joint_names):
        correlation = autocorrelation(longest.residual[:, j])
        line = {"color": _JOINTS[j % len(_JOINTS)], "width": 1.4}
        lags = np.arange(len(correlation)) * step
        figure.add_scatter(x=lags, y=correlation, name=name, mode="lines", line=line)
    figure.update_yaxes(title_text="autocorrelation", range=[-1, 1.05])
    figure.update_xaxes(title_text=f"lag [s], {longest.name}")
    _style(figure, 400)
    return figure.update_layout(legend={"y": 0, "yanchor": "bottom"}, margin={"b": 110})


def friction(report: Report) -> go.Figure:
    """Friction over velocity, the identified law over samples of torque less the rigid body's."""
    names = report.joint_names
    columns = min(4, len(names))
    rows = -(-len(names) // columns)
    spacing = {"vertical_spacing": 0.35 / rows, "horizontal_spacing": 0.06}
    titles = [f"{name} [{unit}]" for name, unit in zip(names, report.torque_units)]
    figure = make_subplots(rows=rows, cols=columns, subplot_titles=titles, **spacing)
    for j in range(len(names)):
        place = {"row": j // columns + 1, "col": j % columns + 1}
        for trace in _friction_traces(report.friction, j) if report.friction else ():
            figure.add_scatter(**trace, showlegend=j == 0, **place)
        figure.update_xaxes(title_text="velocity [rad/s]" if j + columns >= len(names) else "", **place)
    figure.update_annotations(font_size=13)
    return _style(figure, 230 * rows + 70, top=64)


def _friction_traces(law: Friction, joint: int) -> list[dict[str, Any]]:
    """Samples and identified law of one joint."""
    some = slice(None, None, max(1, len(law.measured) // _CLOUD))
    samples = {
        "x": _small(law.measured_velocity[some, joint]),
        "y": _small(law.measured[some, joint]),
        "mode": "markers",
        "marker": {"color": MEASURED, "size": 3, "opacity": 0.5},
        "name": "samples",
    }
    curve = {
        "x": _small(law.velocity[joint]),
        "y": _small(law.torque[joint]),
        "mode": "lines",
        "line": {"color": RESIDUAL, "width": 2},
        "name": "identified",
    }
    return [samples, curve]


def forward(report: Report) -> go.Figure:
    """Error of simulated joints over the time since they were let go, and with servos (dashed)."""
    figure, one = go.Figure(), report.forward["consistent"]
    x = one.horizon.numpy()
    for j, name in enumerate(report.joint_names):
        colour = _JOINTS[j % len(_JOINTS)]
        free, tail, held = (_small(y[:, j].numpy()) for y in (one.free, one.tail, one.held))
        group = {"legendgroup": name, "mode": "lines"}
        figure.add_scatter(x=x, y=free, name=name, line={"color": colour, "width": 1.8}, **group)
        band = {"fill": "tonexty", "line": {"width": 0}, "fillcolor": f"rgba{_rgb(colour)}"}
        figure.add_scatter(x=x, y=tail, showlegend=False, hoverinfo="skip", **band, **group)
        dashed = {"color": colour, "width": 1.2, "dash": "dash"}
        figure.add_scatter(x=x, y=held, showlegend=False, name=f"{name}, with servos", line=dashed, **group)
    figure.update_yaxes(type="log", title_text="error [rad]", exponentformat="power")
    figure.update_xaxes(title_text="time since it was let go [s]")
    return _style(figure, 420)


def _rgb(colour: str) -> tuple[float, ...]:
    """A colour of the style as numbers, nearly transparent."""
    return (*(int(colour[k : k + 2], 16) for k in (1, 3, 5)), 0.08)


def correlations(report: Report) -> go.Figure:
    """Correlation of the parameters' errors, (P, P)."""
    labels = [str(name) for name in report.parameters.name]
    heat = go.Heatmap(
        z=_small(correlation_of(np.asarray(report.covariance))),
        x=labels,
        y=labels,
        zmin=-1,
        zmax=1,
        colorscale="RdBu",
        reversescale=True,
        colorbar={"thickness": 12, "outlinewidth": 0},
        hovertemplate="%{y} · %{x}: %{z:.2f}<extra></extra>",
    )
    figure = go.Figure(heat)
    look = {"showticklabels": len(labels) <= _NAMED, "tickfont_size": 8, "dtick": 1, "ticks": ""}
    look |= {"type": "category", "constrain": "domain"}
    figure.update_xaxes(tickangle=-90, **look)
    figure.update_yaxes(autorange="reversed", scaleanchor="x", **look)
    return _style(figure, 560)


PLOTS: dict[str, Callable[[Report], go.Figure]] = {
    "torques": torques,
    "errors": errors,
    "whiteness": residual_correlation,
    "friction": friction,
    "forward": forward,
    "correlation": correlations,
}


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
    filled = np.nan_to_num(x)
    edges = np.linspace(0, len(x), most // 2 + 1).astype(int)
    extremes = [a + place(filled[a:b]) for a, b in pairwise(edges) for place in (np.argmin, np.argmax)]
    return np.unique(extremes)


def _lines(signals: Signals, joint: int, visible: bool, legend: bool) -> Iterator[go.Scatter]:
    """Measured, predicted and difference of one joint, thinned so that peaks stay."""
    kept = thinned(signals.measured[:, joint], _POINTS)
    lines = {
        "measured": (signals.measured, MEASURED, 2.2),
        "predicted": (signals.predicted, PREDICTED, 1.2),
        "difference": (signals.residual, RESIDUAL, 1.0),
    }
    for name, (values, colour, width) in lines.items():
        yield go.Scatter(
            x=_small(signals.time[kept]),
            y=_small(values[kept, joint]),
            name=name,
            legendgroup=name,
            showlegend=legend,
            visible=visible,
            mode="lines",
            line={"color": colour, "width": width},
            hovertemplate="%{y:.3g}",
        )


def _small(x: Numbers) -> Numbers:
    """Half the bytes; a screen shows less."""
    return np.asarray(x, dtype=np.float32)


def _style(figure: go.Figure, height: int, top: int = 36) -> go.Figure:
    figure.update_layout(
        template="none",
        height=height,
        margin={"l": 64, "r": 16, "t": top, "b": 48},
        font={"family": "system-ui, sans-serif", "size": 12, "color": "#1c2733"},
        legend={"orientation": "h", "x": 0, "y": 1, "yref": "container", "yanchor": "top"},
        bargap=0.3,
    )
    figure.update_xaxes(gridcolor=_GRID, zerolinecolor=_GRID, linecolor="#b8c2cb", automargin=True)
    figure.update_yaxes(gridcolor=_GRID, zerolinecolor="#b8c2cb", automargin=True)
    return figure
