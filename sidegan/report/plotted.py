"""What all plotly figures share: bands, whiskers, dashed lines, the look."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.report.style import lighter
from sidegan.report.summary import Line

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go

_GRID = "rgba(128, 128, 128, 0.22)"
_MIDDLE = {"x": 0.5, "xanchor": "center"}


def whiskers(line: Line) -> dict[str, Any]:
    """Error bars over the range of a line."""
    above, below = line.high - line.mean, line.mean - line.low
    return {
        "type": "data",
        "symmetric": False,
        "array": above,
        "arrayminus": below,
        "thickness": 1,
        "width": 2,
    }


def finish(figure: "go.Figure", height: int) -> "go.Figure":
    """The figure at this height [px], drawn for any background, its legend below."""
    figure.update_layout(
        template="none",
        height=height,
        margin={"l": 64, "r": 16, "t": 40, "b": 84},
        paper_bgcolor="rgba(0, 0, 0, 0)",
        plot_bgcolor="rgba(0, 0, 0, 0)",
        font={"size": 12, "color": "#57606a"},
        legend={"orientation": "h", "yref": "container", "y": 0.005, "yanchor": "bottom", **_MIDDLE},
        modebar={"bgcolor": "rgba(0, 0, 0, 0)", "color": "#8b949e", "activecolor": "#57606a"},
        hoverlabel={"namelength": -1},
    )
    figure.update_annotations(font_size=13)
    figure.update_xaxes(gridcolor=_GRID, zeroline=False, title_standoff=8)
    figure.update_yaxes(gridcolor=_GRID, zeroline=False, automargin=True)
    return figure


def band(line: Line, name: str, shade: str, legend: bool, mode: str = "lines") -> list[Any]:
    """The line through the means, the range behind it."""
    import plotly.graph_objects as go

    x, _, low, high = (part[np.isfinite(line.mean)] for part in line)
    around = go.Scatter(
        x=np.concatenate([x, x[::-1]]),
        y=np.concatenate([high, low[::-1]]),
        fill="toself",
        fillcolor=lighter(shade, 0.2),
        line={"width": 0},
        mode="lines",
        hoverinfo="skip",
        showlegend=False,
        legendgroup=name,
    )
    middle = {"x": line.x, "y": line.mean, "line": {"color": shade, "width": 2}, "mode": mode}
    return [around, go.Scatter(**middle, name=name, legendgroup=name, showlegend=legend)]


def dashed(name: str, value: float, ends: Sequence[Any], shade: str, legend: bool) -> Any:
    """A line at one value."""
    import plotly.graph_objects as go

    line = {"color": shade, "width": 1.6, "dash": "dash"}
    kept = {"name": name, "legendgroup": name, "showlegend": legend, "mode": "lines", "line": line}
    return go.Scatter(x=ends, y=[value, value], **kept)
