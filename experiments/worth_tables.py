"""Tables of the study of motions, for people."""

import numpy as np
import pandas as pd

from experiments.worth_measures import ALL, PRACTICE, SOON, Goal, Worth, median, sides
from sidegan.base.names import plain
from sidegan.worth import Estimate, ratio

OTHERS = tuple(f"best of {x}" for x in (PRACTICE, ALL))
LOOSER = 0.5  # of the floor: a mark that more contenders reach


def table(found: Worth, arm: str) -> pd.DataFrame:
    """A row per contender: robot seconds in each judged regime, excess soon and at the end, design time."""
    settings, rows = found.cfg.worth, {}
    for name, one in found.contenders(arm).items():
        row: dict[str, str] = {}
        for regime in settings.judged:
            row[f"s, {regime}"] = shown(median(found, found.seconds(arm, name, regime, settings.within)))
        for regime in settings.judged[1:]:
            row[f"s to {1 + LOOSER:g} × floor, {regime}"] = shown(
                median(found, found.seconds(arm, name, regime, LOOSER)), brief=True
            )
        for regime in settings.judged:
            ends = (min(SOON, settings.horizon), settings.horizon)
            points = [float(np.median(found.excess(arm, name, regime, t))) for t in ends]
            row[f"points over the floor, {regime}"] = " → ".join(f"{x:.2f}" for x in points)
        seconds = found.design[arm, name]
        row["design [s]"] = plain(seconds) if np.isfinite(seconds) else "—"
        if (share := found.violated[arm, name]) > 0:
            row["beyond a limit [% of the time]"] = f"{100 * share:.2g}"
        rows[f"**{one.title}**" if one.ours else one.title] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("motion").fillna("—")


def intervals(found: Worth, arm: str) -> pd.DataFrame:
    """A row per contender: true parameters that 95 % intervals hold at the end, as they are and widened."""
    rows = {}
    for name, one in found.contenders(arm).items():
        held = {regime: found.covered(arm, name, regime) for regime in found.cfg.worth.judged}
        rows[one.title] = {f"{regime} [%]": f"{x:.0f} → {y:.0f}" for regime, (x, y) in held.items()}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("motion")


def goal_table(judged: list[Goal]) -> pd.DataFrame:
    """Goals for people."""
    rows = [
        {
            "arm": one.arm,
            "regime": one.regime,
            "ours": one.ours,
            "ours [s]": shown(one.seconds),
            "against the best of": one.against,
            "theirs": one.theirs,
            "theirs [s]": shown(one.others),
            "ratio": quotient(one.ratio),
            "goal": _verdict(one) if one.against == PRACTICE else "—",
        }
        for one in judged
    ]
    return pd.DataFrame(rows).set_index("arm")


def _verdict(one: Goal) -> str:
    return "met" if one.sure else "met by the median alone" if one.met else "missed"


def marks(found: Worth) -> pd.DataFrame:
    """Ours against the best that is not ours by other marks than the goal's, on every arm in every regime."""
    settings = found.cfg.worth
    places = [(arm, regime) for arm in found.arms for regime in settings.judged]
    rows = [row for arm, regime in places for row in _marks(found, arm, regime)]
    return pd.DataFrame(rows).set_index("arm")


def _marks(found: Worth, arm: str, regime: str) -> list[dict[str, str]]:
    settings, rows = found.cfg.worth, []
    contenders = found.contenders(arm)
    names = list(contenders)
    kinds = {f"s to {1 + LOOSER:g} × the floor": {x: found.seconds(arm, x, regime, LOOSER) for x in names}}
    for time in (min(SOON, settings.horizon), settings.horizon):
        kinds[f"error after {time:g} s [%]"] = {x: found.after(arm, x, regime, time) for x in names}
    for kind, values in kinds.items():
        medians = {x: float(np.median(value)) for x, value in values.items()}
        row = {"arm": arm, "regime": regime, "mark": kind}
        best = [min(side, key=medians.__getitem__) for side in sides(contenders)]
        for side, x in zip(("ours", *OTHERS), best):
            row[side] = f"{contenders[x].title}: {shown(median(found, values[x]))}"
        for side, x in zip(OTHERS, best[1:]):
            row[f"ours : {side}"] = quotient(ratio(values[best[0]], values[x], settings.resamples))
        rows.append(row)
    return rows


def shown(x: Estimate, brief: bool = False) -> str:
    """A median and its interval for people."""
    words = [plain(v) if np.isfinite(v) else "never" for v in x]
    return words[0] if brief or len(set(words)) == 1 else f"{words[0]} ({words[1]} … {words[2]})"


def quotient(x: Estimate) -> str:
    """A ratio for people, where who never arrives is infinite."""
    if x.median == 0 or np.isinf(x.median):
        return "theirs never" if x.median == 0 else "ours never"
    if x == (1.0, 1.0, 1.0):
        return "neither arrives"
    if x.median == 1.0 and (x.low == 0 or np.isinf(x.high)):  # infinite over infinite, not in every draw
        return "neither by the median"
    words = [plain(v) if np.isfinite(v) else "∞" for v in x]
    return f"{words[0]} × ({words[1]} … {words[2]})"


def estimators(found: Worth, arm: str) -> pd.DataFrame:
    """A row per estimator: its error over the floor, and what its intervals hold, by kind of recording."""
    part, rows = found.estimated[found.estimated.arm == arm], {}
    for method, own in part.groupby("method", sort=False):
        row = {}
        for kind, one in own.groupby("kind", sort=False):
            floor = one.floor.clip(lower=found.cfg.worth.resolution)
            row[f"error over the floor, {kind}"] = plain((one.error / floor).median())
        for kind, one in own.groupby("kind", sort=False):
            both = 100 * one.covered.mean(), 100 * one.widened.mean()
            row[f"intervals hold, {kind} [%]"] = " → ".join(f"{x:.0f}" for x in both)
        rows[str(method)] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("estimator")
