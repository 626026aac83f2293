"""Robot seconds, and intervals over plants and sets."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LEVELS = (0.025, 0.975)


class Estimate(NamedTuple):
    """A median over plants and sets, and its 95 % interval; infinite where it is never reached."""

    median: float
    low: float
    high: float


def seconds_within(times: Array, errors: Array, most: Array) -> Array:
    """First time [s] from which on errors (…, T) stay at or under ``most`` (…), infinite where they do not.

    Times (T,) are ascending; between two of them the crossing is taken on the logarithms' line.
    """
    above = np.log(errors) - np.log(most)[..., None]
    out = above > 0
    last: Any = out.shape[-1] - 1 - np.argmax(out[..., ::-1], -1)  # the last time that is too large
    never, always = out[..., -1], ~out.any(-1)
    low: Any = np.minimum(last, len(times) - 2)
    a, b = (np.take_along_axis(above, k[..., None], -1)[..., 0] for k in (low, low + 1))
    share = np.where(a - b > 0, a / np.where(a - b > 0, a - b, 1.0), 1.0)
    crossing = np.exp(np.log(times[low]) + np.clip(share, 0, 1) * np.log(times[low + 1] / times[low]))
    return np.where(never, np.inf, np.where(always, times[0], crossing))


def resampled(values: Array, count: int, random: np.random.Generator) -> Array:
    """Medians, (count, …), of values (plants, sets, …) whose plants and sets are both drawn anew.

    Contenders along the last axes keep their plants: what they have in common does not widen their ratios.
    """
    plants, sets = values.shape[:2]
    rows = random.integers(plants, size=(count, plants, 1))
    columns = random.integers(sets, size=(count, plants, sets))
    return np.median(values[rows, columns].reshape(count, plants * sets, *values.shape[2:]), 1)


def estimate(values: Array, count: int, seed: int = 0) -> Estimate:
    """Median and interval of values (plants, sets)."""
    low, high = (float(x) for x in _quantiles(resampled(values, count, np.random.default_rng(seed))))
    return Estimate(float(np.median(values)), low, high)


def ratio(ours: Array, theirs: Array, count: int, seed: int = 0) -> Estimate:
    """Ratio of two medians of values (plants, sets), and its interval, paired over plants."""
    both = np.stack([ours, theirs], -1)
    medians = resampled(both, count, np.random.default_rng(seed))
    parts = [_over(x[..., 0], x[..., 1]) for x in (np.median(both, (0, 1)), medians)]
    low, high = (float(x) for x in _quantiles(parts[1]))
    return Estimate(float(parts[0]), low, high)


def _quantiles(x: Array) -> Array:
    """The ends of the interval; a quantile between a number and infinity is the latter."""
    return np.quantile(x, _LEVELS, method="closest_observation")


def _over(a: Array, b: Array) -> Array:
    """Quotient of two, where two that are both infinite are alike."""
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(a) & np.isinf(b), 1.0, a / b)
