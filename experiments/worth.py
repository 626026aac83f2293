"""What a motion is worth: robot seconds until the identified model predicts held-out tasks, by contender."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments import worth_measures as measures
from experiments import worth_tables
from experiments.pages import Page, publish
from experiments.worth_measures import Worth
from sidegan.base.storage import write_json
from sidegan.pipeline.stages.worth import JUDGED, arms, contenders, estimators, plants, sets, worth
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import show
from sidegan.report.style import colours
from sidegan.worth.orders import file_of, seconds_of

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go
    from matplotlib.figure import Figure

_DASHES = {"solid": "solid", "dashed": "dash", "dotted": "dot"}  # Plotly's names
_SHOWN = (0.9, 30.0)  # errors over the floor
_DISTINCT, _COLUMNS = 7, 5  # colours, and columns of the legend


def collect(task: Task) -> Worth:
    """What the stage made."""
    parts, estimated, design, violated = [], [], {}, {}
    for arm, one in arms(task).items():
        for number, group in plants(one):
            parts.append(one.frame(worth(one, number, group)).assign(arm=arm))
            if group == JUDGED and number < one.cfg.worth.compared:
                estimated.append(one.frame(estimators(one, number)).assign(arm=arm))
        for name in contenders(one):
            made = sets(one, name)
            seconds = one.store.costs(made).get("cpu_seconds_per_set", np.nan)
            file = file_of(one.cfg.worth.contenders[name], one.arm.name)
            design[arm, name] = float(seconds) if file is None else seconds_of(file)
            violated[arm, name] = float(one.report(made).get("violated", 0.0))
    frame, errors = (pd.concat(x, ignore_index=True) for x in (parts, estimated))
    return Worth(task.cfg, frame, errors, design, violated)


def present(found: Worth, folder: Path, tracker: Tracker) -> None:
    """Print the tables, and write and record the page ``worth.md`` (and HTML) with ``worth/metrics.json``."""
    tables = {name: worth_tables.table(found, name) for name in found.arms}
    for name, one in tables.items():
        show(one, f"Robot seconds, {name}")
    judged = measures.goals(found)
    tables["goals"], tables["marks"] = worth_tables.goal_table(judged), worth_tables.marks(found)
    tables |= {f"{name}-intervals": worth_tables.intervals(found, name) for name in found.arms}
    tables |= {f"{name}-estimators": worth_tables.estimators(found, name) for name in found.arms}
    drawn = {f"curves-{arm}": curves(found, arm) for arm in found.arms}
    numbers = measures.metrics(found)
    settings = found.cfg.worth
    context = {
        "cfg": found.cfg,
        "settings": settings,
        "arms": found.arms,
        "goals": judged,
        "monday": measures.monday(found),
        "discerning": measures.discerning(found),
        "practice": measures.PRACTICE,
        "best": measures.best(found),
        "estimators": {arm: measures.estimators(found, arm) for arm in found.arms},
        "contenders": {arm: found.contenders(arm) for arm in found.arms},
        "same_ranking": measures.rankings(found),
        "floors": measures.floors(found),
        "looser": 1 + worth_tables.LOOSER,
        "soon": min(measures.SOON, settings.horizon),
    }
    flat = {arm: measures.flat(x) for arm, x in numbers.items()}
    page = Page("worth", tables, drawn, flat, context, _interactive(found))
    target = Path(found.cfg.publish or folder)
    publish(page, target, tracker)
    write_json(target / "worth" / "metrics.json", numbers)


def curves(found: Worth, arm: str) -> "Figure":
    """Median error over the floor, of every contender, a panel per regime."""
    from sidegan.report.canvas import blank, tidy

    settings = found.cfg.worth
    figure = blank(13.0, 5.4)
    axes = figure.subplots(1, len(settings.judged), squeeze=False)[0]
    for axis, regime in zip(axes, settings.judged):
        for (name, one), style in zip(found.contenders(arm).items(), _styles(found, arm)):
            times, errors, floor = found.values(arm, name, regime)
            middle = np.median(errors / floor[..., None], (0, 1))
            axis.plot(times, middle, label=one.title, color=style[0], linestyle=style[1], linewidth=style[2])
        axis.axhline(1 + settings.within, color="black", linewidth=0.8, linestyle=":")
        axis.set(xscale="log", yscale="log", title=regime, xlabel="robot seconds", ylim=_SHOWN)
        tidy(axis)
    axes[0].set_ylabel("error over the floor")
    figure.legend(
        *axes[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=_COLUMNS,
        fontsize=9,
        frameon=False,
    )
    return figure


def _styles(found: Worth, arm: str) -> list[tuple[str, str, float]]:
    """Colour, line style and width of each contender; ours are thick, and no two are alike."""
    few = list(colours(map(str, range(_DISTINCT))).values())
    return [
        (few[k % _DISTINCT], list(_DASHES)[k // _DISTINCT], 3.0 if one.ours else 1.3)
        for k, one in enumerate(found.contenders(arm).values())
    ]


def _interactive(found: Worth) -> "dict[str, go.Figure]":
    """The same curves, for the HTML page."""
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    settings, out = found.cfg.worth, {}
    for arm in found.arms:
        figure = make_subplots(1, len(settings.judged), subplot_titles=settings.judged, shared_yaxes=True)
        for column, regime in enumerate(settings.judged, 1):
            for (name, one), style in zip(found.contenders(arm).items(), _styles(found, arm)):
                times, errors, floor = found.values(arm, name, regime)
                middle = np.median(errors / floor[..., None], (0, 1))
                line = {"color": style[0], "dash": _DASHES[style[1]], "width": style[2]}
                shown = go.Scatter(x=times, y=middle, name=one.title, line=line, legendgroup=name)
                shown.showlegend = column == 1
                figure.add_trace(shown, row=1, col=column)
        figure.update_xaxes(type="log", title="robot seconds")
        figure.update_yaxes(type="log", range=np.log10(_SHOWN).tolist())
        out[f"curves-{arm}"] = figure
    return out
