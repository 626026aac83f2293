"""Verdicts on claims from intervals over trainings and noise draws, and their wording.

An effect is a series of numbers with the levels ``training`` and ``repeat`` (noise draws) in its index, as
far as it has them. Both add to the variance of its mean.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats
from scipy.special import expit, logit

from experiments.artifacts import Artifacts
from sidegan.base.names import plain

HOLDS, NOT = "holds", "does not hold"
UNDECIDED, OPEN = "no detectable difference", "not decided"  # of two that are compared; of one and a bound
UNKNOWN = "not measured"
CONFIDENCE = 0.95
ALONE = "(no interval: one value)"
TRAINING, REPEAT = "training", "repeat"
SIDE_GANS = ("eigen", "diagonal")
GANS = ("vanilla", *SIDE_GANS)
_NEGLIGIBLE = float(np.log(1.05))  # logarithm of a negligible ratio


class Interval(NamedTuple):
    """A mean and its interval."""

    low: float
    mean: float
    high: float

    def turned(self, back: Callable[[float], float]) -> "Interval":
        """The interval of an increasing function of it; infinite ends stay infinite."""
        low, mean, high = (float(back(x)) for x in self)
        return Interval(low, mean, high) if np.isfinite(self.low) else self._replace(mean=mean)


def interval(effect: pd.Series) -> Interval:
    """Mean of an effect with its confidence interval (Student's t).

    The variance of the mean is that over trainings, each averaged over its noise draws, and that over noise
    draws, each averaged over the trainings: too large rather than too small. One training or draw alone has
    no spread, so that the interval is all numbers.
    """
    values = effect.dropna()
    levels = [name for name in (TRAINING, REPEAT) if name in values.index.names]
    means = [values.groupby(level).mean() for level in levels]
    fewest = min((len(x) for x in means), default=0)
    if fewest < 2:
        return Interval(-np.inf, float(values.mean()), np.inf)
    error = np.sqrt(sum(x.var(ddof=1) / len(x) for x in means))
    half = float(stats.t.ppf((1 + CONFIDENCE) / 2, fewest - 1) * error)
    middle = float(values.mean())
    return Interval(middle - half, middle, middle + half)


def of_several(effect: pd.Series) -> pd.Series:
    """An effect without the level of trainings, if there is a single training but several draws."""
    alone = effect.index.nlevels > 1 and effect.index.get_level_values(TRAINING).nunique() == 1
    return effect.droplevel(TRAINING) if alone else effect


def by_set(frame: pd.DataFrame, key: str, trained: Collection[str]) -> dict[str, pd.Series]:
    """Mean of a column for every set by repeat, and by training for trained sets."""
    levels = [name for name in (TRAINING, REPEAT) if name in frame]
    mean = frame.groupby(["set", *levels])[key].mean()
    parts = {str(name): mean.xs(name) for name in mean.index.get_level_values("set").unique()}
    untrained = {  # without the level of trainings; a single value if there is no other level
        name: x.droplevel(TRAINING) if x.index.nlevels > 1 else x.set_axis([0])
        for name, x in parts.items()
        if name not in trained
    }
    return parts | untrained


def log_ratio(first: pd.Series, second: pd.Series) -> pd.Series:
    """Log ratio, draw by draw; a set without trainings is compared with every training of the other."""
    return log_over(np.log(first), np.log(second))


def log_over(first: pd.Series, second: pd.Series) -> pd.Series:
    """Difference of log ratios, draw by draw, matched as by ``log_ratio``."""
    return _matched(first, second) - _matched(second, first)


def log_odds(shares: pd.Series, draws: int) -> pd.Series:
    """Log odds of shares of a number of draws; their intervals, turned back, stay within 0 and 1.

    None and all count as half a draw from the end (Haldane 1956), since their odds have no logarithm.
    """
    edge = 0.5 / draws
    return shares.clip(edge, 1 - edge).map(lambda x: float(logit(x)))


def proportion(share: float, draws: int) -> Interval:
    """A share of a number of draws with its exact interval (Clopper and Pearson 1934)."""
    found = stats.binomtest(round(share * draws), draws).proportion_ci(CONFIDENCE)
    return Interval(found.low, share, found.high)


def above(effect: pd.Series, bound: float | None = None) -> str:
    """Whether an effect's whole interval is above zero, or a bound."""
    bound, undecided = (0.0, UNDECIDED) if bound is None else (bound, OPEN)
    low, mean, high = interval(effect)
    if np.isnan(mean):
        return UNKNOWN
    return HOLDS if low > bound else NOT if high < bound else undecided


def below(effect: pd.Series, bound: float | None = None) -> str:
    """Whether an effect's whole interval is below zero, or a bound."""
    return above(-effect, None if bound is None else -bound)


def not_below(effect: pd.Series, negligible: float = _NEGLIGIBLE) -> str:
    """Whether the whole interval of an effect, by default a log ratio, is above a negligible loss."""
    low, mean, high = interval(effect)
    if np.isnan(mean):
        return UNKNOWN
    return HOLDS if low > -negligible else NOT if high < 0 else UNDECIDED


def within(effect: pd.Series, bound: float) -> str:
    """Whether an effect's whole interval is within a bound of zero."""
    low, mean, high = interval(effect)
    if np.isnan(mean):
        return UNKNOWN
    return HOLDS if -bound < low and high < bound else NOT if low > bound or high < -bound else OPEN


def lies_below(measured: Interval, bound: float) -> str:
    """Verdict on whether a whole interval is below a bound."""
    return HOLDS if measured.high < bound else NOT if measured.low > bound else OPEN


def together(verdicts: Iterable[str]) -> str:
    """The verdict on a claim about several: it holds if it holds of each, and not if it does not of one."""
    parts = set(verdicts)
    if not parts or UNKNOWN in parts:
        return UNKNOWN
    return NOT if NOT in parts else parts.pop() if len(parts) == 1 else OPEN


def tally(verdicts: Iterable[str]) -> str:
    """Text on how many parts of a claim hold and do not; empty if all have the same verdict."""
    parts = list(verdicts)
    if len(set(parts)) < 2:
        return ""
    return f"{parts.count(HOLDS)} of {len(parts)} hold, {parts.count(NOT)} do not: "


@dataclass(frozen=True)
class Judgement:
    """Judgement of a claim: verdict, evidence as text, and numbers for the claim's text."""

    verdict: str
    ours: str
    numbers: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of_each(
        cls, parts: Iterable[str], ours: str, numbers: Mapping[str, Any] | None = None
    ) -> "Judgement":
        """Judgement of a claim about several variants, from the verdict on each; unknown without any."""
        verdicts = list(parts)
        text = tally(verdicts) + ours if verdicts else UNKNOWN
        return cls(together(verdicts), text, dict(numbers or {}))


def by_epoch(made: Artifacts, variant: str, key: str) -> pd.DataFrame:
    """A metric of a variant by epoch (rows) and training (columns)."""
    part = made.histories[made.histories.variant == variant]
    return part.pivot(index="epoch", columns=TRAINING, values=key)


def at(made: Artifacts, variant: str, key: str, first: int, last: int | None = None) -> pd.Series:
    """Mean of a metric over epochs ``first`` to ``last`` (else to the end), by training.

    NaN for a variant whose training ends before these epochs.
    """
    curve = by_epoch(made, variant, key)
    reached = (last or first) in curve.index
    return (curve.loc[first:last] if reached else curve.iloc[:0]).mean()


def words(measured: Interval, form: str = ".3g") -> str:
    """A mean and its interval."""
    if np.isnan(measured.mean):
        return "nothing to measure"
    if not np.isfinite(measured.low):
        return f"{plain(measured.mean, form)} {ALONE}"
    low, high = plain(measured.low, form), plain(measured.high, form)
    return f"{plain(measured.mean, form)} ({low} … {high})"


def shares(log_odds: Mapping[str, pd.Series]) -> str:
    """Text with shares and their intervals, within 0 and 100 %, from log odds by name."""
    return "; ".join(f"{name} {words(interval(x).turned(expit), '.0%')}" for name, x in log_odds.items())


def unless_same(verdict: str, other: str) -> str:
    """Text with the verdict by other numbers, if it differs."""
    return "" if other == verdict else f", for which the verdict would be: {other}"


def intervals(values: Mapping[str, pd.Series]) -> str:
    """Text with means and intervals by name."""
    return "; ".join(f"{name} {words(interval(x))}" for name, x in values.items())


def ratios(effects: Mapping[str, pd.Series]) -> str:
    """Text with geometric means of ratios and their intervals, from log ratios by name."""
    return "; ".join(f"{name} {words(interval(x).turned(np.exp))} ×" for name, x in effects.items())


def _matched(values: pd.Series, other: pd.Series) -> pd.Series:
    """Values without trainings, repeated for each training of the other."""
    if TRAINING in values.index.names or TRAINING not in other.index.names:
        return values
    if other.index.nlevels == 1:
        return pd.Series(values.item(), other.index)
    return values.reindex(other.droplevel(TRAINING).index).set_axis(other.index)
