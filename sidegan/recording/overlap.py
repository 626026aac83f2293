"""Samples that two recordings share, whatever the files' names and the place of the samples in them."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy  # submodules load lazily

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.clock import stamp_text
from sidegan.recording.grid import marked_ranges
from sidegan.recording.recording import Recording

_COUNTED = ("torque", "current", "velocity", "acceleration")  # compared if both recordings have them
_PART, _PARTS = 8.0, 4  # [s] of a recording that are looked for in another, and how many such parts
_REACH, _GROWTH = 0.5, 1.15  # [s] of the longest filter that is found, and ratio of its neighbouring lags
_COARSE = 0.02  # [s] step in which a part is looked for
_ROWS = 800  # of a part to which a filter is fitted
_PLACES = 3  # at which it is compared: periodic motions look alike once a period
_TINY = 1e-30  # of a deviation or variance of torques: keeps quotients finite
_ORDER = 6  # of the differences that only noise is left in
_CALM = 0.25  # share of these that no jump is in


class Digests(NamedTuple):
    """Hashes of a recording's rows, to find recordings with the same rows."""

    time: Array  # of the rows [s], (S,)
    signals: dict[str, Array]  # hashes by name of the signal, (S,) each
    load: str  # torque or current, from which the arm is identified
    torque: Array  # this signal in single precision, (S, J)

    def changing(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Combined hashes of signals, and times, of rows in which the first signal changes, (K,) each."""
        first = self.signals[names[0]]
        keep = np.append(True, first[1:] != first[:-1])
        return _hashes(np.stack([self.signals[name] for name in names], 1))[keep], self.time[keep]


def digests_of(recording: Recording) -> Digests:
    """Digests of a recording's rows in single precision, which some files use."""
    single = {name: x.astype(np.float32) + np.float32(0) for name, x in recording.signals().items()}
    signals = {name: _hashes(x) for name, x in single.items()}
    return Digests(recording.time, signals, recording.load, single[recording.load])


def refuse_shared(recordings: Sequence[tuple[str, Digests]]) -> None:
    """Refuse named recordings if any two of them share a stretch of samples or torques."""
    for (first, a), (second, b) in combinations(recordings, 2):
        common = ["position", *(n for n in _COUNTED if n in a.signals and n in b.signals)]
        hashes, _ = a.changing(common)
        others, time = b.changing(common)
        if where := _stretch(np.isin(others, hashes), time):
            raise RecordingError(
                f"{second} holds samples of {first}, {where}: they would count twice, "
                "or a model would be validated on its own training data"
            )
        hashes, _ = a.changing([a.load])
        others, time = b.changing([b.load])
        if where := _stretch(_in_order(hashes, others), time):
            raise RecordingError(
                f"{second} has the same torques as {first}, {where}, but another motion: "
                "one of the two has the torques of another recording"
            )


def same_run(first: Digests, second: Digests) -> bool:
    """Whether one recording is a part of the other, exported again: filtered, resampled, shifted or rounded.

    A filter then makes its torques, with their noise, from the other's. Repetitions have other noise.
    """
    for source, copy in ((first, second), (second, first)):
        noise, other = _noise(source.torque), _noise(copy.torque)
        share, shown = noise / _deviation(source.torque), other / _deviation(copy.torque)
        if (share >= shown / 2).all() and any(_is_copy(source, noise, *part) for part in _parts(copy)):
            return True
    return False


def _deviation(torque: Array) -> Array:
    """Standard deviation of torques (S, J), (J,), not zero."""
    return np.maximum(torque.std(0), _TINY)


def _noise(torque: Array) -> Array:
    """Standard deviation of the white noise of torques (S, J), (J,), where they do not jump."""
    least = np.quantile(np.abs(np.diff(torque, _ORDER, axis=0)), _CALM, axis=0)
    usual = scipy.stats.norm.ppf((1 + _CALM) / 2) * scipy.special.comb(2 * _ORDER, _ORDER) ** 0.5
    return np.asarray(least / usual)


def _parts(recording: Digests) -> Iterator[tuple[Array, Array]]:
    """Times (K,) [s] and torques (K, J) of parts of a recording, without its ends, which filters distort."""
    begin, end = np.searchsorted(recording.time, recording.time[[0, -1]] + [_REACH, -_REACH])
    count = max(1, round((recording.time[-1] - recording.time[0]) / _PART))
    rows = [part for part in np.array_split(np.arange(begin, end), count) if len(part)]
    for part in rows[:: -(-count // _PARTS)]:
        yield recording.time[part], recording.torque[part]


def _is_copy(source: Digests, noise: Array, time: Array, torque: Array) -> bool:
    """Whether filters of the source, with noise (J,), make torques (K, J) at times (K,) with its noise."""
    step = float(np.median(np.diff(source.time)))
    away = np.unique(np.round(_GROWTH ** np.arange(math.log(max(_REACH / step, 1), _GROWTH))))
    edges = np.concatenate([-away[::-1] - 0.5, [-0.5, 0.5], away + 0.5]) * step  # of the lags' intervals
    between = np.concatenate([source.time[:1], (source.time[1:] + source.time[:-1]) / 2, source.time[-1:]])
    few = slice(None, None, max(1, len(time) // _ROWS))
    noisy = np.flatnonzero(noise).tolist()

    def left(j: int, at: Array) -> float:
        """Variance that a filter leaves, as a share of that of the noise which it passes."""
        integral = np.append(0.0, np.cumsum(source.torque[:, j] * np.diff(between)))
        means = np.diff(np.interp(at, between, integral), axis=1) / np.diff(edges)
        columns = np.append(means, np.ones((len(at), 1)), 1)
        weights = np.linalg.lstsq(columns, torque[few, j])[0]
        passed = min((np.square(weights[:-1]) * step / np.diff(edges)).sum(), weights[:-1].sum() ** 2)
        squares = np.square(torque[few, j] - columns @ weights).sum()
        return float(squares / max(len(at) - 2 * len(edges), 1e-9) / max(passed * noise[j] ** 2, _TINY))

    places = [time[few, None] + offset + edges for offset in _places(source, time, torque)]
    return bool(noisy) and any(all(left(j, at) < thresholds.COPIED_NOISE for j in noisy) for at in places)


def _places(source: Digests, time: Array, torque: Array) -> list[float]:
    """Offsets [s] to the times of a part (K,) at which its torques (K, J) are like the source's."""
    whole = _coarse(source.time, source.torque)
    part = _coarse(time, torque)
    if not 0 < len(part) <= len(whole):
        return []
    squares = np.convolve(np.square(whole).sum(1), np.ones(len(part)), "valid")
    products = scipy.signal.correlate(whole, part, "valid")[:, 0]
    apart = squares - 2 * products + np.square(part).sum()
    near = round(_REACH / _COARSE)
    found: list[float] = []
    while len(found) < _PLACES and apart[best := int(apart.argmin())] < thresholds.LIKE_PART * part.size:
        found.append(float(source.time[0] - time[0]) + best * _COARSE)
        apart[max(0, best - near) : best + near] = np.inf
    return found


def _coarse(time: Array, torque: Array) -> Array:
    """Torques (S, J) of unit deviation on a coarse grid, (K, J)."""
    at = np.arange(time[0], time[-1], _COARSE)
    scaled = torque / _deviation(torque)
    return np.stack([np.interp(at, time, x) for x in scaled.T], -1)


def _stretch(common: Array, time: Array) -> str:
    """Start and end of the longest stretch of common rows, as text; empty if it may be a coincidence."""
    begins, ends = marked_ranges(common)
    if not (ends - begins >= thresholds.SAME_ROWS).any():
        return ""
    longest = int(np.argmax(ends - begins))
    begin, end = time[[begins[longest], ends[longest] - 1]]
    return f"from {stamp_text(begin)} to {stamp_text(end)}"


def _in_order(hashes: Array, others: Array) -> Array:
    """Which of the other rows occur in the same order; coarse currents repeat by coincidence."""
    order = np.argsort(hashes, kind="stable")
    place = order[np.searchsorted(hashes, others, sorter=order).clip(max=len(hashes) - 1)]
    same = hashes[place] == others
    next_ = same[1:] & same[:-1] & (place[1:] == place[:-1] + 1)
    return np.append(False, next_) | np.append(next_, False)


def _hashes(rows: Array) -> Array:
    """A hash of each row (S, C), (S,)."""
    return np.asarray(pd.util.hash_pandas_object(pd.DataFrame(rows), index=False), dtype=np.uint64)
