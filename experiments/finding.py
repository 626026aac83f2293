"""Findings on one claim under one condition, and their words."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import expit

from experiments.artifacts import Artifacts
from experiments.verdicts import TRAINING, Interval, interval, tally, together
from sidegan.base.names import plain

SIDE_GANS = ("eigen", "diagonal")
GANS = ("vanilla", *SIDE_GANS)


@dataclass(frozen=True)
class Judgement:
    """Judgement of one claim: verdict, evidence in words, numbers for the words of the claim."""

    verdict: str
    ours: str
    numbers: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of_each(
        cls, parts: Iterable[str], ours: str, numbers: Mapping[str, Any] | None = None
    ) -> "Judgement":
        """Judgement of a claim about several, by the verdicts on each of them."""
        every = list(parts)
        return cls(together(every), tally(every) + ours, dict(numbers or {}))


def by_epoch(made: Artifacts, variant: str, key: str) -> pd.DataFrame:
    """A metric of a variant by epoch (rows) and training (columns)."""
    part = made.histories[made.histories.variant == variant]
    return part.pivot(index="epoch", columns=TRAINING, values=key)


def at(made: Artifacts, variant: str, key: str, first: int, last: int | None = None) -> pd.Series:
    """Mean of a metric over epochs ``first`` to ``last`` (else to the end), by training."""
    curve = by_epoch(made, variant, key)
    begin = min(first, len(curve)) - 1
    return curve.iloc[begin : len(curve) if last is None else max(last, begin + 1)].mean()


def words(measured: Interval, form: str = ".3g") -> str:
    """A mean and its interval."""
    if np.isnan(measured.mean):
        return "nothing to measure"
    if not np.isfinite(measured.low):
        return f"{plain(measured.mean, form)} (no interval: one alone)"
    low, high = plain(measured.low, form), plain(measured.high, form)
    return f"{plain(measured.mean, form)} ({low} … {high})"


def shares(log_odds: Mapping[str, pd.Series]) -> str:
    """Shares and their intervals, which lie within 0 and 100 %, of their log odds by name."""
    return "; ".join(f"{name} {words(interval(x).turned(expit), '.0%')}" for name, x in log_odds.items())


def unless_same(verdict: str, other: str) -> str:
    """A verdict by other numbers, in words, where it is another one."""
    return "" if other == verdict else f", by which the verdict would be: {other}"


def intervals(values: Mapping[str, pd.Series]) -> str:
    """Means and intervals by name."""
    return "; ".join(f"{name} {words(interval(x))}" for name, x in values.items())


def ratios(effects: Mapping[str, pd.Series]) -> str:
    """Geometric means of ratios and their intervals, of their logarithms by name."""
    return "; ".join(f"{name} {words(interval(x).turned(np.exp))} ×" for name, x in effects.items())
