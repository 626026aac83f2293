"""Statistics of a raw recording, from one walk through it: its clock, its motion's bandwidth, each signal."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from torch import Tensor

from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording.frozen import Frozen, Stays
from sidegan.recording.overlap import Rows, joined, rows_of
from sidegan.recording.recording import Recording
from sidegan.recording.tables import Numbers

SLOWEST = 0.5  # [s] between samples, with which no arm's motion is recorded
_GAP_STEPS = 5.0  # sampling steps that are still interpolated over
_LEAST_SAMPLES = 10
_HEAD = 120.0  # [s] of a recording from which the bandwidth is measured
_HEAD_RATE = 50.0  # [Hz] at which that is done
_LEAST_HEAD = 16  # points of it
_MOVED = 0.005  # [rad or m] away from where it stood, the arm moves
_ENERGY = 0.98  # of the motion's energy lies below its bandwidth
_CLIPPED = 5  # consecutive samples at the very same extreme
_SECOND_DIFFERENCE = math.sqrt(6)  # of white noise, over the noise itself


@dataclass(frozen=True)
class Signal:
    """Statistics of one signal of all joints as it was recorded, (J,) each, SI units."""

    lower: Tensor  # smallest value
    upper: Tensor  # largest value
    noise: Tensor  # standard deviation of white noise with the same second differences: the noise floor
    quantum: Tensor  # smallest step between neighbouring samples
    clipped: Tensor  # longest stay at an extreme, in samples

    @property
    def largest(self) -> Tensor:
        """Largest absolute value, (J,)."""
        return torch.maximum(self.lower.abs(), self.upper.abs())

    @property
    def constant(self) -> Tensor:
        """Whether all samples have the same value, (J,)."""
        return self.lower == self.upper


@dataclass(frozen=True)
class Statistics:
    """Statistics of a raw recording."""

    name: str  # of the recording
    samples: int  # whole rows
    duration: float  # from first to last sample [s]
    step: float  # mean time between samples, gaps apart [s]
    jitter: float  # standard deviation of that time over its mean
    duplicates: int  # rows with the time stamp of the row before
    gaps: tuple[tuple[float, float], ...]  # start and length of every gap [s]
    gap: float  # time above which it is one [s]
    bridged: int  # shorter stretches without samples, over five steps long, that are interpolated over
    corrupt: tuple[tuple[int, str], ...]  # row and reason of what was left out
    # frequency below which nearly all of the motion's energy lies [Hz]; 0 where nothing moves, or the samples
    # are further apart than those of any motion
    bandwidth: float
    frozen: tuple[Frozen, ...]  # the longest stretch of each joint whose torque or current stays as it is
    signals: dict[str, Signal]  # by name
    rows: Rows  # digests of some rows, by which another recording with the same samples is found


def statistics_of(
    recording: Recording | Iterable[Recording],
    gap: float | None = None,
    bridged: Callable[[float], float] | None = None,
) -> Statistics:
    """Statistics of a recording, from one walk through its pieces.

    Args:
        recording: whole, or its consecutive pieces.
        gap: time between samples that is a gap [s]; None: five sampling steps, or what may be bridged.
        bridged: time that may be interpolated over [s], of a bandwidth [Hz].

    Raises:
        RecordingError: when there are too few samples, or time runs backwards.
    """
    times: list[Numbers] = []
    corrupt: list[tuple[int, str]] = []
    tallies: dict[str, _Tally] = {}
    rows: list[Rows] = []
    stays = Stays()
    head: list[Recording] = []  # from where the arm begins to move
    first: Tensor | None = None
    name = ""
    for part in [recording] if isinstance(recording, Recording) else recording:
        name = part.name
        corrupt += part.corrupt
        if not len(part):
            continue
        times.append(part.time.numpy())
        rows.append(rows_of(part))
        stays.add(part)
        first = part.position[0] if first is None else first
        begun = bool(head) or bool(((part.position - first).abs() > _MOVED).any())
        if begun and float(part.time[0] - (head or [part])[0].time[-1]) < _HEAD:
            head.append(part)
        for signal, x in part.signals().items():
            tallies.setdefault(signal, _Tally()).add(x.numpy())
    samples = sum(map(len, times))
    if samples < _LEAST_SAMPLES:
        raise RecordingError(
            f"{name or 'the recording'} holds {counted(samples, 'sample')}, expected {_LEAST_SAMPLES} or more"
        )
    clock = clock_of(name, np.concatenate(times), gap)
    bandwidth = bandwidth_of(head, clock["step"]) if head and clock["step"] <= SLOWEST else 0.0
    if gap is None and bridged is not None and bandwidth:
        limit = max(clock["gap"], bridged(bandwidth))
        long = tuple(one for one in clock["gaps"] if one[1] > limit)
        clock |= {"gap": limit, "gaps": long, "bridged": len(clock["gaps"]) - len(long)}
    signals = {signal: tally.result() for signal, tally in tallies.items()}
    found: dict[str, Any] = {"bandwidth": bandwidth, "signals": signals, "rows": joined(rows)}
    return Statistics(name, samples, **clock, corrupt=tuple(corrupt), frozen=stays.frozen, **found)


def clock_of(name: str, time: Numbers, gap: float | None = None) -> dict[str, Any]:
    """Those of the statistics that follow from the time stamps [s], (S,); ``name`` is for messages.

    Raises:
        RecordingError: when time runs backwards, or stands still.
    """
    steps = np.diff(time)
    if (steps < 0).any():
        row = int(np.argmax(steps < 0))
        raise RecordingError(
            f"{name}: time runs backwards, from {time[row]:.6g} s to {time[row + 1]:.6g} s, "
            f"after sample {row + 1}"
        )
    forward = steps[steps > 0]
    if not len(forward):
        raise RecordingError(f"{name}: all samples have the same time stamp, {time[0]:.6g} s")
    limit = gap or _GAP_STEPS * float(np.median(forward))
    regular = forward[forward <= limit]
    if not len(regular):
        raise RecordingError(f"{name}: all samples are further apart than the longest gap, {limit:g} s")
    step = float(regular.mean())
    return {
        "duration": float(time[-1] - time[0]),
        "step": step,
        "jitter": float(regular.std()) / step,
        "duplicates": int((steps == 0).sum()),
        "gaps": tuple((float(time[i]), float(steps[i])) for i in np.flatnonzero(steps > limit)),
        "gap": limit,
        "bridged": 0,
    }


def bandwidth_of(head: list[Recording], step: float | None = None) -> float:
    """Frequency [Hz] below which nearly all energy of the joints' velocities lies; 0 where nothing moves.

    The pieces are consecutive, with a time [s] between samples; without one, each is a motion by itself and
    the largest of theirs counts. White noise of the positions, which is seen above half of the highest
    frequency, is taken off first.
    """
    if step is None:
        return max(bandwidth_of([part], float(part.time.diff().median())) for part in head)
    time = np.concatenate([part.time.numpy() for part in head])
    position = np.concatenate([part.position.numpy() for part in head])
    start = int(np.argmax((np.abs(position - position[0]) > _MOVED).any(1)))
    keep = np.append(True, np.diff(time) > 0)
    rate = min(_HEAD_RATE, 1 / step)
    grid = np.arange(time[start], min(time[-1], time[start] + _HEAD), 1 / rate)
    if len(grid) < _LEAST_HEAD:
        raise RecordingError(
            f"{head[0].name} moves for {time[-1] - time[start]:.3g} s, too short to identify from"
        )
    velocity = np.stack([np.gradient(np.interp(grid, time[keep], q[keep])) for q in position.T], 1)
    power = (np.abs(np.fft.rfft(velocity * np.hanning(len(grid))[:, None], axis=0)) ** 2).sum(1)
    frequency = np.fft.rfftfreq(len(grid), 1 / rate)
    gain = np.sin(2 * np.pi * frequency / rate) ** 2  # of the central difference
    upper = slice(len(grid) // 4, -2)
    power = np.clip(power - gain * np.median(power[upper] / gain[upper]), 0, None)
    if not power.sum() > 0:
        return 0.0
    index = int(np.searchsorted(np.cumsum(power), _ENERGY * power.sum()))
    return float(frequency[max(index, 1)])


@dataclass
class _Tally:
    """Statistics of a signal, gathered piece by piece."""

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
        self.runs.append((_longest_run(x, x.min(0)), _longest_run(x, x.max(0))))
        if len(x) > 2:
            second = np.diff(x, 2, axis=0)
            self.squares.append((second**2).sum(0))
            self.samples += len(second)
            steps = np.abs(np.diff(x, axis=0))
            self.quanta.append(np.where(steps > 0, steps, np.inf).min(0))

    def result(self) -> Signal:
        """Statistics over all pieces."""
        lower, upper = np.min(self.lower, 0), np.max(self.upper, 0)
        clipped = np.zeros_like(lower)
        for (at_low, at_high), low, high in zip(self.runs, self.lower, self.upper):
            clipped = np.maximum(clipped, np.where(low == lower, at_low, 0))
            clipped = np.maximum(clipped, np.where(high == upper, at_high, 0))
        noise = np.sqrt(np.sum(self.squares, 0) / self.samples) / _SECOND_DIFFERENCE
        quantum = np.min(self.quanta, 0)
        quantum = np.where(np.isfinite(quantum), quantum, 0)
        clipped = np.where((clipped >= _CLIPPED) & (upper > lower), clipped, 0)
        return Signal(*(torch.from_numpy(x) for x in (lower, upper, noise, quantum, clipped)))


def _longest_run(x: Numbers, value: Numbers) -> Numbers:
    """Most consecutive samples (S, J) of exactly ``value`` (J,), (J,)."""
    at = np.pad(x == value, ((1, 1), (0, 0)))
    edges = [np.flatnonzero(np.diff(column)) for column in at.T]
    return np.array([max(np.diff(edge)[::2], default=0) for edge in edges], dtype=np.float64)
