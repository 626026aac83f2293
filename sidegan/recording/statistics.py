"""Statistics of a raw recording: bandwidth of the motion, signals, frozen torques."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.clock import Clock, clock_of
from sidegan.recording.grid import constant_ranges, marked_ranges
from sidegan.recording.overlap import Digests, digests_of
from sidegan.recording.recording import Recording
from sidegan.recording.settings import RecordingSettings

HEADROOM = 12.0  # ratio of the low-pass's cut-off to the motion's bandwidth
_HEAD = 120.0  # [s] at the start of the motion from which the bandwidth is measured
_HEAD_RATE = 50.0  # [Hz] sampling rate of that part
_MOVED = 0.005  # [rad or m] from its initial position beyond which the arm moves
_ENERGY = 0.98  # share of the motion's energy below its bandwidth


class Signal(NamedTuple):
    """Statistics of a raw signal of all joints, (J,) each, SI units."""

    lower: Array  # smallest value
    upper: Array  # largest value
    quantum: Array  # smallest nonzero step between neighbouring samples
    clipped: Array  # longest time at an extreme, in samples

    @property
    def largest(self) -> Array:
        """Largest absolute value, (J,)."""
        return np.maximum(np.abs(self.lower), np.abs(self.upper))

    @property
    def constant(self) -> Array:
        """Whether all samples have the same value, (J,)."""
        return self.lower == self.upper


@dataclass(frozen=True, kw_only=True)
class Statistics(Clock):
    """Statistics of a raw recording."""

    name: str  # of the recording
    samples: int  # rows that are not corrupt
    corrupt: tuple[tuple[int, str], ...]  # row numbers and reasons of corrupt rows
    # frequency below which nearly all of the motion's energy lies [Hz]; 0 if nothing moves or the samples are
    # implausibly far apart
    bandwidth: float
    load: Literal["torque", "current"]  # signal from which the arm is identified
    # joints that move while their torque or current is constant, with start and end of the widest motion [s]
    frozen: tuple[tuple[int, float, float], ...]
    signals: dict[str, Signal]  # by name
    rows: Digests  # to find other recordings with the same samples


def statistics_of(recording: Recording, settings: RecordingSettings) -> Statistics:
    """Statistics of a recording; the gap follows from the settings and the motion's bandwidth."""
    name = recording.name
    samples = len(recording)
    time = recording.time
    if samples < thresholds.LEAST_SAMPLES:
        least = thresholds.LEAST_SAMPLES
        raise RecordingError(f"{name} has {counted(samples, 'sample')}, expected {least} or more")
    clock = clock_of(name, time, settings.gap)
    slow = clock.step > thresholds.LONGEST_STEP
    bandwidth = 0.0 if slow else bandwidth_of(name, time, recording.position, clock.step)
    if settings.gap is None and bandwidth:
        limit = max(clock.gap, thresholds.GAP_PERIODS / (settings.cutoff or HEADROOM * bandwidth))
        long = tuple(gap for gap in clock.gaps if gap[1] > limit)
        clock = replace(clock, gap=limit, gaps=long, bridged=len(clock.gaps) - len(long))
    return Statistics(
        **vars(clock),
        name=name,
        samples=samples,
        corrupt=recording.corrupt,
        bandwidth=bandwidth,
        load=recording.load,
        frozen=_frozen(recording),
        signals={key: _signal(x) for key, x in recording.signals().items()},
        rows=digests_of(recording),
    )


def bandwidth_of(name: str, time: Array, position: Array, step: float) -> float:
    """Frequency [Hz] below which nearly all energy of the joints' velocities lies; 0 if nothing moves.

    Positions are (S, J) at times (S,), ``step`` [s] apart; the name is for messages. White position noise,
    estimated above half of the Nyquist frequency, is subtracted first.
    """
    moved = (np.abs(position - position[0]) > _MOVED).any(1)
    if not moved.any():
        return 0.0
    start = int(moved.argmax())
    rate = min(_HEAD_RATE, 1 / step)
    grid = np.arange(time[start], min(time[-1], time[start] + _HEAD), 1 / rate)
    if len(grid) < thresholds.LEAST_MOTION:
        raise RecordingError(f"{name} moves for {time[-1] - time[start]:.3g} s, too short to identify from")
    head = slice(start, np.searchsorted(time, grid[-1], "right") + 1)
    keep = np.append(True, np.diff(time[head]) > 0)
    velocity = np.stack(
        [np.gradient(np.interp(grid, time[head][keep], q[head][keep])) for q in position.T], 1
    )
    power = (np.abs(np.fft.rfft(velocity * np.hanning(len(grid))[:, None], axis=0)) ** 2).sum(1)
    frequency = np.fft.rfftfreq(len(grid), 1 / rate)
    gain = np.sin(2 * np.pi * frequency / rate) ** 2  # of the central difference
    upper = slice(len(grid) // 4, -2)
    power = np.clip(power - gain * np.median(power[upper] / gain[upper]), 0, None)
    if not power.sum() > 0:
        return 0.0
    index = int(np.searchsorted(np.cumsum(power), _ENERGY * power.sum()))
    return float(frequency[max(index, 1)])


def _signal(x: Array) -> Signal:
    """Statistics of a signal (S, J); joint by joint, since a long recording then takes little memory."""
    found = []
    for column in x.T:
        lower, upper = column.min(), column.max()
        steps = np.abs(np.diff(column))
        quantum = steps.min(where=steps > 0, initial=np.inf)
        clipped = max(_longest_at(column, end, quantum) for end in (lower, upper)) if upper > lower else 0
        mean = len(column) / (1 + np.count_nonzero(steps))  # run of equal samples: held or quantised signals
        clipped = clipped if clipped >= thresholds.SATURATED * mean else 0.0
        found.append((lower, upper, quantum if np.isfinite(quantum) else 0.0, clipped))
    return Signal(*np.array(found).T)


def _longest_at(x: Array, extreme: float, quantum: float) -> float:
    """Length of the longest run of samples (S,) at an extreme, not next to a longer time one quantum from it.

    That is the peak of a coarsely quantised signal: it spends 0.4 times as long at the next value, or more.
    """
    begins, ends = marked_ranges(x == extreme)
    first, last = marked_ranges(np.abs(x - extreme) < 1.5 * quantum)
    around = np.searchsorted(first, begins, "right") - 1
    longer = (last - first)[around] - (ends - begins)
    return float((ends - begins).max(where=longer <= thresholds.PEAK * (ends - begins), initial=0))


def _frozen(recording: Recording) -> tuple[tuple[int, float, float], ...]:
    """Joint, start and end [s] of the widest motion with a constant torque or current, if wide enough."""
    found = []
    time = recording.time
    load = recording.signals()[recording.load]
    for j, (q, x) in enumerate(zip(recording.position.T, load.T)):
        begins, ends = constant_ranges(x[:, None])
        travel = np.maximum.reduceat(q, begins) - np.minimum.reduceat(q, begins)
        travel[ends - begins + 1 < thresholds.FROZEN_SAMPLES] = 0.0
        widest = int(travel.argmax())
        if travel[widest] > thresholds.FROZEN * np.ptp(q):
            found.append((j, float(time[begins[widest]]), float(time[ends[widest]])))
    return tuple(found)
