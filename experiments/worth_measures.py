"""What the study of motions measures: robot seconds, goals, rankings, whether it tells motions apart."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from sidegan.pipeline.settings import Config
from sidegan.worth import Contender, Estimate, estimate, ratio, seconds_within

PRACTICE, ALL = "practice", "all others"
SOON = 16.0  # [s] after which errors are compared, beside the end


@dataclass(frozen=True)
class Goal:
    """Ours against the best of others, on one arm in one regime."""

    arm: str
    regime: str
    against: str  # which others: those of practice, which the goal is about, or all
    ours: str
    theirs: str
    seconds: Estimate  # of ours
    others: Estimate  # of the best of the others
    ratio: Estimate
    goal: float  # that the ratio may have at most

    @property
    def met(self) -> bool:
        """Whether the median arrives and is small enough."""
        return bool(np.isfinite(self.seconds.median) and self.ratio.median <= self.goal)

    @property
    def sure(self) -> bool:
        """Whether the whole interval is."""
        return self.met and self.ratio.high <= self.goal


@dataclass(frozen=True)
class Worth:
    """The settings, and a row per arm, contender, plant, set, regime and time; design times in seconds."""

    cfg: Config
    frame: pd.DataFrame
    estimated: pd.DataFrame  # a row per arm, plant, kind of recording and estimator
    design: dict[tuple[str, str], float]
    violated: dict[tuple[str, str], float]  # share of the time in which a set is beyond a limit

    @property
    def arms(self) -> list[str]:
        """Arms that were studied."""
        return list(self.frame.arm.unique())

    def contenders(self, arm: str) -> dict[str, Contender]:
        """Who contends on an arm."""
        names = set(self.frame[self.frame.arm == arm].contender)
        return {name: one for name, one in self.cfg.worth.contenders.items() if name in names}

    def regimes(self, arm: str) -> list[str]:
        """Regimes that were made of an arm."""
        return list(self.frame[self.frame.arm == arm].regime.unique())

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

    def covered(self, arm: str, name: str, regime: str) -> tuple[float, float]:
        """Shares of the true parameters [%] that 95 % intervals hold at the end, as they are and widened."""
        frame = self.frame
        part = frame[(frame.arm == arm) & (frame.contender == name) & (frame.regime == regime)]
        return 100 * float(part.covered.mean()), 100 * float(part.widened.mean())

    def excess(self, arm: str, name: str, regime: str, time: float) -> np.ndarray:
        """Error above the floor after a time, in points of percent, (plants, sets)."""
        return self.after(arm, name, regime, time) - 100 * self.values(arm, name, regime)[2]


def goals(found: Worth) -> list[Goal]:
    """Our best contender against the best of practice, and of all others, on every arm in every regime."""
    settings, out = found.cfg.worth, []
    for arm in found.arms:
        for regime in settings.judged:
            contenders = found.contenders(arm)
            seconds = {x: found.seconds(arm, x, regime, settings.within) for x in contenders}
            end = {x: np.median(found.after(arm, x, regime, settings.horizon)) for x in seconds}
            # Among those that never arrive, the closest at the end.
            order = {x: (np.median(seconds[x]), end[x]) for x in seconds}
            ours, *best = (min(side, key=order.__getitem__) for side in sides(contenders))
            for against, theirs in zip((PRACTICE, ALL), best):
                share = ratio(seconds[ours], seconds[theirs], settings.resamples)
                mine, other = (median(found, seconds[x]) for x in (ours, theirs))
                titles = contenders[ours].title, contenders[theirs].title
                out.append(Goal(arm, regime, against, *titles, mine, other, share, settings.goal))
    return out


def best(found: Worth) -> dict[str, dict[str, tuple[str, float]]]:
    """By arm: who has the lowest score of all, of practice and of ours, each with that score."""
    out = {}
    for arm in found.arms:
        contenders = found.contenders(arm)
        means = np.exp(scores(found, arm, found.cfg.worth.judged).mean(axis=1))
        ours, practice, others = sides(contenders)
        parts = {"ours": ours, PRACTICE: practice, ALL: others}
        names = {part: min(side, key=means.__getitem__) for part, side in parts.items()}
        out[arm] = {part: (contenders[x].title, float(means[x])) for part, x in names.items()}
    return out


def estimators(found: Worth, arm: str) -> dict[str, str]:
    """The estimator with the smallest median error, by kind of recording."""
    part = found.estimated[found.estimated.arm == arm]
    medians = part.groupby(["kind", "method"], sort=False).error.median().unstack("method")
    return {str(kind): str(method) for kind, method in medians.idxmin(axis=1).items()}


def sides(contenders: Mapping[str, Contender]) -> tuple[list[str], list[str], list[str]]:
    """Names of contenders that are ours, of practice, and of all others that are not known to be bad.

    None of the three is empty: settings without ours or practice are refused.
    """
    fair = {x: one for x, one in contenders.items() if not one.bad}
    ours = [x for x, one in fair.items() if one.ours]
    return ours, [x for x in fair if fair[x].practice], [x for x in fair if not fair[x].ours]


def monday(found: Worth) -> dict[str, list[tuple[str, str]]]:
    """For each arm, contenders from the best on: mean error over the floor over all times and regimes."""
    out = {}
    for arm in found.arms:
        means = scores(found, arm, found.cfg.worth.judged).mean(axis=1).sort_values()
        titles = {x: one.title for x, one in found.contenders(arm).items()}
        out[arm] = [(titles[str(name)], f"{np.exp(x):.2f}") for name, x in means.items()]
    return out


def scores(found: Worth, arm: str, regimes: list[str]) -> pd.DataFrame:
    """Mean logarithm over all times of the error over the floor, of each contender in each regime."""
    rows = {}
    for name in found.contenders(arm):
        values = (found.values(arm, name, regime) for regime in regimes)
        rows[name] = [float(np.log(errors / floor[..., None]).mean()) for _, errors, floor in values]
    return pd.DataFrame.from_dict(rows, orient="index", columns=regimes)


def rankings(found: Worth) -> dict[str, float]:
    """Rank correlation, by arm, of the contenders under the two families of misfits."""
    regimes = found.cfg.worth.regimes
    other = [x for x in regimes if x not in found.cfg.worth.judged]
    if not other or "misfit" not in regimes:
        return {}
    made = [arm for arm in found.arms if other[0] in found.regimes(arm)]
    ranks = {arm: scores(found, arm, ["misfit", other[0]]) for arm in made}
    return {arm: float(np.corrcoef(one.rank().to_numpy().T)[0, 1]) for arm, one in ranks.items()}


def discerning(found: Worth) -> dict[str, dict[float, bool]]:
    """Whether sets that are known to be bad come last, with intervals apart, soon and at the end, by arm.

    Nothing where there are no such sets: then nothing is known.
    """
    settings = found.cfg.worth
    if not any(one.bad for one in settings.contenders.values()):
        return {}
    times = min(SOON, settings.horizon), settings.horizon
    return {arm: {time: _apart(found, arm, time) for time in times} for arm in found.arms}


def _apart(found: Worth, arm: str, time: float) -> bool:
    contenders, apart = found.contenders(arm), []
    for regime in found.cfg.worth.judged:
        ends = {x: median(found, found.after(arm, x, regime, time)) for x in contenders}
        bad = [ends[x].low for x, one in contenders.items() if one.bad]
        good = [ends[x].high for x, one in contenders.items() if not one.bad]
        apart.append(min(bad) > max(good))
    return all(apart)


def floors(found: Worth) -> dict[str, dict[str, float]]:
    """Median floor [%] by arm and regime."""
    medians = found.frame.groupby(["arm", "regime"]).floor.median()
    return {arm: {r: 100 * float(medians[arm, r]) for r in found.regimes(arm)} for arm in found.arms}


def metrics(found: Worth) -> dict[str, Any]:
    """Robot seconds of every contender by arm and regime: median and interval, null where never."""
    settings = found.cfg.worth
    return {
        arm: {
            name: {
                regime: {
                    **_numbers(median(found, found.seconds(arm, name, regime, settings.within))),
                    "excess": float(f"{np.median(found.excess(arm, name, regime, settings.horizon)):.4g}"),
                }
                for regime in found.regimes(arm)
            }
            for name in found.contenders(arm)
        }
        for arm in found.arms
    }


def _numbers(x: Estimate) -> dict[str, float | None]:
    return {k: float(f"{v:.4g}") if np.isfinite(v) else None for k, v in x._asdict().items()}


def flat(numbers: dict[str, Any]) -> dict[str, float]:
    """What MLflow records: medians that are finite, and the excess."""
    return {
        f"{name}_{regime}_{key}": x[key]
        for name, regimes in numbers.items()
        for regime, x in regimes.items()
        for key in ("median", "excess")
        if x[key] is not None
    }


def median(found: Worth, values: np.ndarray) -> Estimate:
    """Median and interval of values (plants, sets)."""
    return estimate(values, found.cfg.worth.resamples)
