"""The figures of ``figures`` once more, with plotly: to zoom, to read values, to hide lines."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from sidegan.report.plotted import band, dashed, finish, whiskers
from sidegan.report.style import PANELS, colour, colours, seconds
from sidegan.report.summary import (
    History,
    aligned,
    by_joint,
    compared_with,
    curves,
    durations,
    epochs,
    is_text,
    require,
    time_ticks,
    weighting,
)
from sidegan.report.tables import title

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go


def training(
    histories: Mapping[str, Sequence[History]],
    seeds: Mapping[str, Any],
    union: Mapping[str, Any] | None = None,
) -> "go.Figure":
    """Metrics after every epoch; see ``figures.training``."""
    from plotly.subplots import make_subplots

    heads = [label for label, _ in PANELS.values()]
    figure = make_subplots(2, 3, subplot_titles=heads, vertical_spacing=0.16, horizontal_spacing=0.08)
    for k, (key, (_, logarithmic)) in enumerate(PANELS.items()):
        place = {"row": k // 3 + 1, "col": k % 3 + 1}
        for name, runs in histories.items():
            line = epochs(runs, key)
            figure.add_traces(band(line, name, colour(name), k == 0), rows=place["row"], cols=place["col"])
        for name, words, value in compared_with(key, seeds, union):
            length = max((len(run) for runs in histories.values() for run in runs), default=1)
            shown = words not in {trace.name for trace in figure.data}
            figure.add_trace(dashed(words, value, [1, length], colour(name), shown), **place)
        figure.update_yaxes(type="log" if logarithmic else "linear", **place)
    figure.update_xaxes(title_text="epoch", row=2)
    return finish(figure, 640)


def errors(raw: pd.DataFrame) -> "go.Figure":
    """NMSE by joint and set; see ``figures.errors``."""
    from plotly.subplots import make_subplots

    weightings = sorted(raw.weighted.unique())
    heads = [weighting(weighted) for weighted in weightings]
    figure = make_subplots(1, len(weightings), shared_yaxes=True, subplot_titles=heads)
    for column, weighted in enumerate(weightings, 1):
        for name, line in by_joint(raw[raw.weighted == weighted]).items():
            bar = {"x": line.x, "y": line.mean, "error_y": whiskers(line), "marker_color": colour(name)}
            known = {"name": title(name), "legendgroup": name, "showlegend": column == 1}
            figure.add_bar(**bar, **known, row=1, col=column)
    figure.update_yaxes(type="log", title_text="nMSE", col=1)
    figure.update_yaxes(type="log")
    return finish(figure, 440)


def curve(
    frame: pd.DataFrame,
    x: str,
    y: str,
    group: str | None = None,
    *,
    log_x: bool = False,
    log_y: bool = False,
    labels: Mapping[str, str] | None = None,
    references: Mapping[str, float] | None = None,
) -> "go.Figure":
    """Column ``y`` over column ``x``, means and ranges; see ``figures.curve``."""
    import plotly.graph_objects as go

    words = labels or {}
    found = aligned(curves(frame, x, y, group))
    figure = go.Figure()
    for name, shade in colours(found).items():
        line, known = found[name], words.get(name, name)
        if is_text(frame[x]):
            figure.add_trace(
                go.Scatter(
                    x=line.x,
                    y=line.mean,
                    error_y=whiskers(line),
                    mode="markers",
                    name=known,
                    marker={"color": shade, "size": 9},
                )
            )
        else:
            figure.add_traces(band(line, known, shade, bool(known), mode="lines+markers"))
    places = list(dict.fromkeys(place for line in found.values() for place in line.x))
    ends = [places[0], places[-1]] if is_text(frame[x]) else [min(places), max(places)]
    for name, value in (references or {}).items():
        figure.add_trace(dashed(words.get(name, name), value, ends, colour(name), True))
    figure.update_xaxes(title_text=words.get(x, x), type="log" if log_x else None)
    if log_x:
        figure.update_xaxes(tickvals=places, ticktext=[f"{place:g}" for place in places])
    figure.update_yaxes(title_text=words.get(y, y), type="log" if log_y else None)
    if is_text(frame[x]):
        figure.update_layout(scattermode="group")  # beside each other
    return finish(figure, 440)


def quality_diversity(
    frame: pd.DataFrame,
    quality: str,
    diversity: str,
    kind: str,
    *,
    log: bool = True,
    labels: Mapping[str, str] | None = None,
) -> "go.Figure":
    """A point per row; see ``figures.quality_diversity``."""
    import plotly.graph_objects as go

    require(frame, [quality, diversity, kind])
    words = labels or {}
    figure = go.Figure()
    for name, shade in colours(frame[kind].astype(str)).items():
        part = frame[frame[kind].astype(str) == name]
        dots = {"color": shade, "size": 6, "opacity": 0.5 if len(part) > 50 else 0.9}
        known = f"{words.get(name, name)} ({len(part)})"
        figure.add_scatter(x=part[diversity], y=part[quality], mode="markers", name=known, marker=dots)
        middle = {"color": shade, "size": 16, "symbol": "cross", "line": {"color": "white", "width": 1.5}}
        x, y = [part[diversity].median()], [part[quality].median()]
        figure.add_scatter(x=x, y=y, mode="markers", name=f"{words.get(name, name)}, median", marker=middle)
    figure.update_xaxes(title_text=words.get(diversity, diversity))
    figure.update_yaxes(title_text=words.get(quality, quality), type="log" if log else "linear")
    return finish(figure, 460)


def timing(frame: pd.DataFrame) -> "go.Figure":
    """Durations, ours beside the paper's; see ``figures.timing``."""
    import plotly.graph_objects as go

    low, high = durations(frame)
    figure = go.Figure()
    for name in ("paper", "ours"):
        words = [seconds(x) if pd.notna(x) else "" for x in frame[name]]
        bars = {"text": words, "textposition": "outside", "marker_color": colour(name), "cliponaxis": False}
        figure.add_bar(y=frame.what, x=frame[name], orientation="h", name=name, hoverinfo="y+text", **bars)
    ticks = time_ticks(low, high)
    figure.update_xaxes(type="log", range=np.log10([low, high]).tolist())
    figure.update_xaxes(tickvals=ticks, ticktext=[seconds(t) for t in ticks])
    figure.update_yaxes(autorange="reversed", automargin=True)
    return finish(figure, 46 * len(frame) + 130)
