"""One walk through a raw recording: its clock, and what each signal is like before it is filtered."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from torch import Tensor

from sidegan.errors import RecordingError
from sidegan.recording.recording import Recording
from sidegan.recording.signals import Signal, Tally
from sidegan.recording.tables import Numbers

GAP_STEPS = 5.0  # sampling steps that are still interpolated over
_HEAD = 120.0  # [s] of a recording from which the bandwidth is measured
_HEAD_RATE = 50.0  # [Hz] at which that is done
_LEAST_HEAD = 16  # points of it
_MOVED = 0.005  # [rad or m] away from where it stood, the arm moves
_ENERGY = 0.98  # of the motion's energy lies below its bandwidth


@dataclass(frozen=True)
class Survey:
    """What a raw recording is like.

    Attributes:
        name: of the recording.
        samples: whole rows.
        duration: from first to last sample [s].
        step: mean time between samples, gaps apart [s].
        jitter: standard deviation of that time over its mean.
        duplicates: rows with the time stamp of the row before.
        gaps: start and length of every gap [s].
        gap: time above which it is one [s].
        corrupt: row and reason of what was left out.
        bandwidth: frequency below which nearly all of the motion's energy lies [Hz].
        signals: by name.
    """

    name: str
    samples: int
    duration: float
    step: float
    jitter: float
    duplicates: int
    gaps: tuple[tuple[float, float], ...]
    gap: float
    corrupt: tuple[tuple[int, str], ...]
    bandwidth: float
    signals: dict[str, Signal]


def survey(recording: Recording | Iterable[Recording], gap: float | None = None) -> Survey:
    """What a recording is like, from one walk through its pieces.

    Args:
        recording: whole, or its consecutive pieces.
        gap: time between samples that is a gap [s]; None: five sampling steps.

    Raises:
        RecordingError: when there are too few samples, or time runs backwards.
    """
    times: list[Numbers] = []
    corrupt: list[tuple[int, str]] = []
    tallies: dict[str, Tally] = {}
    head: list[Recording] = []  # from where the arm begins to move
    first: Tensor | None = None
    name = ""
    for part in [recording] if isinstance(recording, Recording) else recording:
        name = part.name
        corrupt += part.corrupt
        if not len(part):
            continue
        times.append(part.time.numpy())
        first = part.position[0] if first is None else first
        begun = bool(head) or bool(((part.position - first).abs() > _MOVED).any())
        if begun and float(part.time[0] - (head or [part])[0].time[-1]) < _HEAD:
            head.append(part)
        for signal, x in part.signals().items():
            tallies.setdefault(signal, Tally()).add(x.numpy())
    if sum(map(len, times)) < 10:
        raise RecordingError(
            f"{name or 'the recording'} holds {sum(map(len, times))} samples, expected 10 or more"
        )
    clock = _clock(name, np.concatenate(times), gap)
    bandwidth = _bandwidth(head, clock[1]) if head else 0.0
    signals = {signal: tally.result() for signal, tally in tallies.items()}
    return Survey(name, sum(map(len, times)), *clock, tuple(corrupt), bandwidth, signals)


Clock = tuple[float, float, float, int, tuple[tuple[float, float], ...], float]


def _clock(name: str, time: Numbers, gap: float | None) -> Clock:
    """Duration, step, jitter, duplicates, gaps, and the time above which it is a gap."""
    steps = np.diff(time)
    if (steps < 0).any():
        row = int(np.argmax(steps < 0))
        raise RecordingError(
            f"{name}: time runs backwards, from {time[row]:.6g} s to {time[row + 1]:.6g} s, "
            f"after sample {row + 1}"
        )
    moving = steps[steps > 0]
    if not len(moving):
        raise RecordingError(f"{name}: all samples have the same time stamp, {time[0]:.6g} s")
    limit = gap or GAP_STEPS * float(np.median(moving))
    regular = moving[moving <= limit]
    if not len(regular):
        raise RecordingError(f"{name}: all samples are further apart than the longest gap, {limit:g} s")
    where = np.flatnonzero(steps > limit)
    gaps = tuple((float(time[i]), float(steps[i])) for i in where)
    step = float(regular.mean())
    duplicates = int((steps == 0).sum())
    return float(time[-1] - time[0]), step, float(regular.std()) / step, duplicates, gaps, limit


def _bandwidth(head: list[Recording], step: float) -> float:
    """Frequency [Hz] below which nearly all energy of the joints' velocities lies; 0 where nothing moves.

    White noise of the positions, which is seen above half of the highest frequency, is taken off first.
    """
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


def reasons(corrupt: Iterable[tuple[int, str]]) -> dict[str, int]:
    """How often each reason occurs, most frequent first."""
    return dict(Counter(reason for _, reason in corrupt).most_common())
