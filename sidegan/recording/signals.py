"""What a raw signal is like: range, noise floor, quantisation, saturation."""

import math
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from sidegan.recording.tables import Numbers

_CLIPPED = 5  # consecutive samples at the very same extreme
_SECOND_DIFFERENCE = math.sqrt(6)  # of white noise, over the noise itself


@dataclass(frozen=True)
class Signal:
    """One signal of all joints as it was recorded, (J,) each, SI units.

    Attributes:
        lower: smallest value.
        upper: largest value.
        noise: standard deviation of white noise with the same second differences: the noise floor.
        quantum: smallest step between neighbouring samples.
        clipped: longest stay at an extreme, in samples.
    """

    lower: Tensor
    upper: Tensor
    noise: Tensor
    quantum: Tensor
    clipped: Tensor


@dataclass
class Tally:
    """Statistics of a signal that are gathered piece by piece."""

    lower: list[Numbers] = field(default_factory=list)
    upper: list[Numbers] = field(default_factory=list)
    squares: list[Numbers] = field(default_factory=list)
    quanta: list[Numbers] = field(default_factory=list)
    runs: list[tuple[Numbers, Numbers]] = field(default_factory=list)
    samples: int = 0

    def add(self, x: Numbers) -> None:
        """Take in a piece (S, J)."""
        self.lower.append(x.min(0))
        self.upper.append(x.max(0))
        self.runs.append((_longest(x, x.min(0)), _longest(x, x.max(0))))
        if len(x) > 2:
            second = np.diff(x, 2, axis=0)
            self.squares.append((second**2).sum(0))
            self.samples += len(second)
            steps = np.abs(np.diff(x, axis=0))
            self.quanta.append(np.where(steps > 0, steps, np.inf).min(0))

    def result(self) -> Signal:
        """Over all pieces."""
        lower, upper = np.min(self.lower, 0), np.max(self.upper, 0)
        clipped = np.zeros_like(lower)
        for (at_low, at_high), low, high in zip(self.runs, self.lower, self.upper):
            clipped = np.maximum(clipped, np.where(low == lower, at_low, 0))
            clipped = np.maximum(clipped, np.where(high == upper, at_high, 0))
        noise = np.sqrt(np.sum(self.squares, 0) / self.samples) / _SECOND_DIFFERENCE
        quantum = np.min(self.quanta, 0)
        clipped = np.where((clipped >= _CLIPPED) & (upper > lower), clipped, 0)
        found = (lower, upper, noise, np.where(np.isfinite(quantum), quantum, 0), clipped)
        return Signal(*(torch.from_numpy(np.asarray(x, dtype=np.float64)) for x in found))


def _longest(x: Numbers, value: Numbers) -> Numbers:
    """Most consecutive samples (S, J) of exactly ``value`` (J,), (J,)."""
    at = np.pad(x == value, ((1, 1), (0, 0)))
    found = []
    for column in at.T:
        edges = np.flatnonzero(np.diff(column))
        found.append(max(np.diff(edges)[::2], default=0))
    return np.array(found, dtype=np.float64)
