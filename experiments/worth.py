"""What a motion is worth: robot seconds until the identified model predicts held-out tasks, by contender."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.pages import Page, publish
from sidegan.base.storage import write_json
from sidegan.pipeline.settings import Config
from sidegan.pipeline.stages.worth import arms, sets, worth
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import show
from sidegan.worth import Contender, Estimate, estimate, ratio, seconds_within

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go
    from matplotlib.figure import Figure

LOOSER = 0.5  # of the floor: a mark that more contenders reach
SOON = 16.0  # [s] after which errors are compared, beside the end


@dataclass(frozen=True)
class Goal:
    """Ours against the best contender that is not, on one arm in one regime."""

    arm: str
    regime: str
    ours: str
    theirs: str
    seconds: Estimate  # of ours
    others: Estimate  # of the best contender that is not
    ratio: Estimate
    met: bool


@dataclass(frozen=True)
class Worth:
    """The settings, and a row per arm, contender, plant, set, regime and time; design times in seconds."""

    cfg: Config
    frame: pd.DataFrame
    design: dict[tuple[str, str], float]

    @property
    def arms(self) -> list[str]:
        """Arms that were studied."""
        return list(self.frame.arm.unique())

    def values(self, arm: str, name: str, regime: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (T,), errors (plants, sets, T) and floors (plants, sets), at least the resolution."""
        frame = self.frame
        part = frame[(frame.arm == arm) & (frame.contender == name) & (frame.regime == regime)]
        part = part.sort_values(["plant", "set", "time"])
        shape = part.plant.nunique(), part.set.nunique(), -1
        floor = part.floor.to_numpy().reshape(shape)[..., 0]
        errors = part.error.to_numpy().reshape(shape)
        return part.time.unique(), errors, np.maximum(floor, self.cfg.worth.resolution)

    def seconds(self, arm: str, name: str, regime: str, within: float) -> np.ndarray:
        """Robot seconds until the error stays within a share of the floor, (plants, sets)."""
        times, errors, floors = self.values(arm, name, regime)
        return seconds_within(times, errors, (1 + within) * floors)

    def after(self, arm: str, name: str, regime: str, time: float) -> np.ndarray:
        """Error after a time [%], (plants, sets)."""
        times, errors, _ = self.values(arm, name, regime)
        return 100 * errors[..., int(np.abs(times - time).argmin())]

    def excess(self, arm: str, name: str, regime: str, time: float) -> np.ndarray:
        """Error above the floor after a time, in points of percent, (plants, sets)."""
        return self.after(arm, name, regime, time) - 100 * self.values(arm, name, regime)[2]


def collect(task: Task) -> Worth:
    """What the stage made."""
    parts, design = [], {}
    for arm, one in arms(task).items():
        for name in one.cfg.worth.contenders:
            parts.append(one.frame(worth(one, name)).assign(arm=arm, contender=name))
            design[arm, name] = float(one.store.costs(sets(one, name)).get("cpu_seconds_per_set", np.nan))
    return Worth(task.cfg, pd.concat(parts, ignore_index=True), design)


def present(found: Worth, folder: Path, tracker: Tracker) -> None:
    """Print the tables, and write and record the page ``worth.md`` (and HTML) with ``worth/metrics.json``."""
    tables = {name: table(found, name) for name in found.arms}
    for name, one in tables.items():
        show(one, f"Robot seconds, {name}")
    judged = goals(found)
    tables["goals"], tables["marks"] = goal_table(judged), marks(found)
    drawn = {f"curves-{arm}": curves(found, arm) for arm in found.arms}
    numbers = metrics(found)
    settings = found.cfg.worth
    context = {
        "cfg": found.cfg,
        "settings": settings,
        "arms": found.arms,
        "goals": judged,
        "monday": monday(found),
        "discerning": discerning(found),
        "looser": LOOSER,
        "same_ranking": rankings(found),
        "floors": floors(found),
    }
    flat = {arm: _flat(x) for arm, x in numbers.items()}
    page = Page("worth", tables, drawn, flat, context, _interactive(found))
    target = Path(found.cfg.publish or folder)
    publish(page, target, tracker)
    write_json(target / "worth" / "metrics.json", numbers)


def table(found: Worth, arm: str) -> pd.DataFrame:
    """A row per contender: robot seconds in each judged regime, excess soon and at the end, design time."""
    settings, rows = found.cfg.worth, {}
    for name, one in settings.contenders.items():
        row: dict[str, str] = {}
        for regime in settings.judged:
            row[f"s, {regime}"] = _shown(_median(found, found.seconds(arm, name, regime, settings.within)))
        for regime in settings.judged[1:]:
            row[f"s to {1 + LOOSER:g} × floor, {regime}"] = _shown(
                _median(found, found.seconds(arm, name, regime, LOOSER)), brief=True
            )
        for regime in settings.judged:
            ends = (min(SOON, settings.horizon), settings.horizon)
            points = [float(np.median(found.excess(arm, name, regime, t))) for t in ends]
            row[f"points over the floor, {regime}"] = " → ".join(f"{x:.2f}" for x in points)
        row["design [s]"] = f"{found.design[arm, name]:.3g}"
        rows[f"**{one.title}**" if one.ours else one.title] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("motion")


def goals(found: Worth) -> list[Goal]:
    """Our best contender against the best that is not ours, on every arm in every judged regime."""
    settings, out = found.cfg.worth, []
    for arm in found.arms:
        for regime in settings.judged:
            seconds = {x: found.seconds(arm, x, regime, settings.within) for x in settings.contenders}
            ours, theirs = (_best(found, seconds, side, arm, regime) for side in (True, False))
            if ours is None or theirs is None:
                continue
            share = ratio(seconds[ours], seconds[theirs], settings.resamples)
            mine, other = (_median(found, seconds[x]) for x in (ours, theirs))
            met = bool(np.isfinite(mine.median) and share.median <= settings.goal)
            titles = settings.contenders[ours].title, settings.contenders[theirs].title
            out.append(Goal(arm, regime, titles[0], titles[1], mine, other, share, met))
    return out


def _best(found: Worth, seconds: dict[str, np.ndarray], ours: bool, arm: str, regime: str) -> str | None:
    """The contender of one side with the smallest median; among those that never arrive, the closest."""
    names = _sides(found.cfg.worth.contenders)[0 if ours else 1]
    if not names:
        return None
    end = found.cfg.worth.horizon
    return min(names, key=lambda x: (np.median(seconds[x]), np.median(found.excess(arm, x, regime, end))))


def goal_table(judged: list[Goal]) -> pd.DataFrame:
    """Goals for people."""
    rows = [
        {
            "arm": one.arm,
            "regime": one.regime,
            "ours": one.ours,
            "ours [s]": _shown(one.seconds),
            "best that is not": one.theirs,
            "theirs [s]": _shown(one.others),
            "ratio": _shown(one.ratio, unit="×", nothing="none arrives"),
            "goal": "met" if one.met else "missed",
        }
        for one in judged
    ]
    return pd.DataFrame(rows).set_index("arm")


def marks(found: Worth) -> pd.DataFrame:
    """Ours against the best that is not ours by other marks than the goal's, on every arm in every regime."""
    settings = found.cfg.worth
    places = [(arm, regime) for arm in found.arms for regime in settings.judged]
    rows = [row for arm, regime in places for row in _marks(found, arm, regime)]
    return pd.DataFrame(rows).set_index("arm")


def _marks(found: Worth, arm: str, regime: str) -> list[dict[str, str]]:
    settings, rows = found.cfg.worth, []
    names = list(settings.contenders)
    kinds = {f"s to {1 + LOOSER:g} × the floor": {x: found.seconds(arm, x, regime, LOOSER) for x in names}}
    for time in (min(SOON, settings.horizon), settings.horizon):
        kinds[f"error after {time:g} s [%]"] = {x: found.after(arm, x, regime, time) for x in names}
    for kind, values in kinds.items():
        medians = {x: float(np.median(value)) for x, value in values.items()}
        ours, theirs = (min(side, key=medians.__getitem__) for side in _sides(settings.contenders))
        share = ratio(values[ours], values[theirs], settings.resamples)
        row = {"arm": arm, "regime": regime, "mark": kind}
        for side, x in (("ours", ours), ("best that is not", theirs)):
            row[side] = settings.contenders[x].title
            row[f"by {side}"] = _shown(_median(found, values[x]))
        rows.append(row | {"ratio": _shown(share, unit="×", nothing="none arrives")})
    return rows


def _sides(contenders: Mapping[str, Contender]) -> tuple[list[str], list[str]]:
    """Names of contenders that are ours, and of those that are neither ours nor known to be bad."""
    ours = [x for x, one in contenders.items() if one.ours]
    return ours, [x for x, one in contenders.items() if not (one.ours or one.bad)]


def monday(found: Worth) -> dict[str, list[tuple[str, str]]]:
    """For each arm, contenders from the best on: the mean rank over judged regimes of the whole curve."""
    out = {}
    for arm in found.arms:
        ranks = scores(found, arm, found.cfg.worth.judged).mean(axis=1).sort_values()
        titles = {x: one.title for x, one in found.cfg.worth.contenders.items()}
        out[arm] = [(titles[str(name)], f"{x:.1f}") for name, x in ranks.items()]
    return out


def scores(found: Worth, arm: str, regimes: list[str]) -> pd.DataFrame:
    """Rank of each contender in each regime by its median log error over all times, 1 the best."""
    rows = {}
    for name in found.cfg.worth.contenders:
        values = (found.values(arm, name, regime) for regime in regimes)
        rows[name] = [float(np.log(errors / floor[..., None]).mean(-1).mean()) for _, errors, floor in values]
    return pd.DataFrame.from_dict(rows, orient="index", columns=regimes).rank()


def rankings(found: Worth) -> dict[str, float]:
    """Rank correlation, by arm, of the contenders under the two families of misfits."""
    regimes = found.cfg.worth.regimes
    other = [x for x in regimes if x not in found.cfg.worth.judged]
    if not other or "misfit" not in regimes:
        return {}
    ranks = {arm: scores(found, arm, ["misfit", *other[:1]]) for arm in found.arms}
    return {arm: float(np.corrcoef(one.to_numpy().T)[0, 1]) for arm, one in ranks.items()}


def discerning(found: Worth) -> dict[str, bool]:
    """Whether the sets that are known to be bad come last at the end, with intervals apart, by arm."""
    settings, out = found.cfg.worth, {}
    for arm in found.arms:
        apart = []
        for regime in settings.judged:
            last = {
                x: estimate(found.excess(arm, x, regime, settings.horizon), settings.resamples)
                for x in settings.contenders
            }
            bad = [last[x].low for x, one in settings.contenders.items() if one.bad]
            good = [last[x].high for x, one in settings.contenders.items() if not one.bad]
            apart += [min(bad) > max(good)] if bad and good else []
        out[arm] = all(apart)
    return out


def floors(found: Worth) -> dict[str, dict[str, float]]:
    """Median floor [%] by arm and regime."""
    medians = found.frame.groupby(["arm", "regime"]).floor.median()
    return {arm: {r: 100 * float(medians[arm, r]) for r in found.cfg.worth.regimes} for arm in found.arms}


def metrics(found: Worth) -> dict[str, Any]:
    """Robot seconds of every contender by arm and regime: median and interval, null where never."""
    settings = found.cfg.worth
    return {
        arm: {
            name: {
                regime: {
                    **_numbers(_median(found, found.seconds(arm, name, regime, settings.within))),
                    "excess": float(f"{np.median(found.excess(arm, name, regime, settings.horizon)):.4g}"),
                }
                for regime in settings.regimes
            }
            for name in settings.contenders
        }
        for arm in found.arms
    }


def _numbers(x: Estimate) -> dict[str, float | None]:
    return {k: float(f"{v:.4g}") if np.isfinite(v) else None for k, v in x._asdict().items()}


def _flat(numbers: dict[str, Any]) -> dict[str, float]:
    """What MLflow records: medians that are finite, and the excess."""
    return {
        f"{name}_{regime}_{key}": x[key]
        for name, regimes in numbers.items()
        for regime, x in regimes.items()
        for key in ("median", "excess")
        if x[key] is not None
    }


def _median(found: Worth, values: np.ndarray) -> Estimate:
    return estimate(values, found.cfg.worth.resamples)


def _shown(x: Estimate, brief: bool = False, unit: str = "", nothing: str = "never") -> str:
    """A median and its interval for people."""
    if np.isnan(x.median) or (unit and x.median == 1.0 == x.low == x.high):
        return nothing
    words = [f"{v:.3g}" if np.isfinite(v) else nothing for v in x]
    end = f" {unit}" if unit else ""
    return (
        f"{words[0]}{end}" if brief or len(set(words)) == 1 else f"{words[0]}{end} ({words[1]} … {words[2]})"
    )


def curves(found: Worth, arm: str) -> "Figure":
    """Median error over the floor, of every contender, a panel per regime."""
    from sidegan.report.canvas import Line, band, blank, legend, tidy
    from sidegan.report.style import colours

    settings = found.cfg.worth
    figure = blank(13.0, 4.6)
    titles = [one.title for one in settings.contenders.values()]
    shades, handles = colours(titles), {}
    for axis, regime in zip(figure.subplots(1, len(settings.judged), squeeze=False)[0], settings.judged):
        for name, one in settings.contenders.items():
            times, errors, floor = found.values(arm, name, regime)
            relative = errors / floor[..., None]
            middle = np.median(relative, (0, 1))
            spread = np.quantile(relative, (0.25, 0.75), (0, 1)) if one.ours else (middle, middle)
            handles[one.title] = band(axis, Line(times, middle, *spread), one.title, shades[one.title])
        axis.axhline(1 + settings.within, color="black", linewidth=0.8, linestyle="--")
        axis.set(xscale="log", yscale="log", title=regime, xlabel="robot seconds")
        axis.set_ylim(0.95, 30)
        tidy(axis)
    figure.axes[0].set_ylabel("error over the floor")
    legend(figure, handles)
    return figure


def _interactive(found: Worth) -> "dict[str, go.Figure]":
    """The same curves, for the HTML page."""
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    from sidegan.report.style import colours

    settings, out = found.cfg.worth, {}
    shades = colours([one.title for one in settings.contenders.values()])
    for arm in found.arms:
        figure = make_subplots(1, len(settings.judged), subplot_titles=settings.judged, shared_yaxes=True)
        for column, regime in enumerate(settings.judged, 1):
            for name, one in settings.contenders.items():
                times, errors, floor = found.values(arm, name, regime)
                middle = np.median(errors / floor[..., None], (0, 1))
                line = {"color": shades[one.title], "width": 3 if one.ours else 1.5}
                shown = go.Scatter(x=times, y=middle, name=one.title, line=line, legendgroup=name)
                shown.showlegend = column == 1
                figure.add_trace(shown, row=1, col=column)
        figure.update_xaxes(type="log", title="robot seconds")
        figure.update_yaxes(type="log")
        out[f"curves-{arm}"] = figure
    return out
