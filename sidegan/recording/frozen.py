"""Torques and currents that stay the same while their joint moves: a sensor or a log that stood still."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sidegan.recording.recording import Recording
from sidegan.recording.tables import Numbers

_MOVED = 0.3  # of its range in the recording, through which a joint moves while its torque does not change
_LEAST = 20  # samples; a few that are alike are a coarse quantum


class Frozen(NamedTuple):
    """A stretch in which the torque or current of a joint does not change, and the joint moves."""

    joint: int  # counted from 0
    begin: float  # time of its first sample [s]
    end: float  # time of its last sample [s]


class _Stay(NamedTuple):
    """Consecutive samples of one joint with the same torque."""

    value: float  # torque [N·m or N] or current [A]
    begin: float  # [s]
    end: float  # [s]
    samples: int
    lower: float  # smallest position [rad or m]
    upper: float  # largest position [rad or m]

    @property
    def travel(self) -> float:
        """Range of positions [rad or m]; none of so few samples that they say nothing."""
        return self.upper - self.lower if self.samples >= _LEAST else 0.0

    def and_then(self, other: "_Stay") -> "_Stay":
        """This one and the one that follows it."""
        lower, upper = min(self.lower, other.lower), max(self.upper, other.upper)
        return _Stay(self.value, self.begin, other.end, self.samples + other.samples, lower, upper)


@dataclass
class Stays:
    """Stretches of constant torque or current, gathered piece by piece."""

    last: dict[int, _Stay] = field(default_factory=dict)  # by joint: what may go on in the next piece
    most: dict[int, _Stay] = field(default_factory=dict)  # by joint: the one with the widest motion
    span: dict[int, tuple[float, float]] = field(default_factory=dict)  # by joint: its positions [rad or m]

    def add(self, part: Recording) -> None:
        """Take in a piece, which is not empty."""
        load = part.current if part.torque is None else part.torque
        if load is None:
            return
        time, position = part.time.numpy(), part.position.numpy()
        for j, (q, x) in enumerate(zip(position.T, load.numpy().T)):
            low, high = self.span.get(j, (np.inf, -np.inf))
            self.span[j] = min(low, float(q.min())), max(high, float(q.max()))
            stays = _stays(time, q, x)
            if j in self.last and self.last[j].value == stays[0].value:
                stays[0] = self.last[j].and_then(stays[0])
            self.last[j] = stays[-1]
            self.most[j] = max([*([self.most[j]] if j in self.most else []), *stays], key=_travel)

    @property
    def frozen(self) -> tuple[Frozen, ...]:
        """Of each joint the stretch with the widest motion, where that is wide enough."""
        wide = {j: _MOVED * (high - low) for j, (low, high) in self.span.items()}
        return tuple(Frozen(j, one.begin, one.end) for j, one in self.most.items() if one.travel > wide[j])


def _travel(stay: _Stay) -> float:
    return stay.travel


def _stays(time: Numbers, position: Numbers, load: Numbers) -> list[_Stay]:
    """The first, the last, and the one with the widest motion of a joint's stretches of constant torque.

    Signals are (S,) each.
    """
    begins = np.append(0, np.flatnonzero(np.diff(load)) + 1)
    ends = np.append(begins[1:], len(load)) - 1
    lower, upper = np.minimum.reduceat(position, begins), np.maximum.reduceat(position, begins)
    samples = ends - begins + 1
    widest = int(np.where(samples >= _LEAST, upper - lower, 0.0).argmax())
    some = sorted({0, widest, len(begins) - 1})
    columns = load[begins], time[begins], time[ends], samples, lower, upper
    return [_Stay(*row) for row in zip(*(x[some].tolist() for x in columns))]
