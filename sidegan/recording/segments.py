"""Preprocessing: from raw recordings to filtered states and torques on a uniform grid."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, shift

from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording.grid import Run, derivative, low_pass, runs
from sidegan.recording.recording import SIGN_WIDTH, Recording, Segment
from sidegan.recording.settings import RecordingSettings
from sidegan.recording.statistics import HEADROOM, Statistics, statistics_of
from sidegan.recording.tables import Numbers

_OVERSAMPLING = 10.0  # samples that are kept per period of the cut-off
_AT_ONCE = 50_000  # points of the grid that are filtered at once
_FORGOTTEN = 20.0  # periods of the cut-off, after which the filter has forgotten all but 1e-12 of a sample
_PAUSE = 0.1  # [s]: samples this close to a motion are kept
_LEAST_POINTS = 8  # of a segment
_LEAST_PERIODS = 4.0  # of the cut-off in a recording: as long as the edges of the filter


@dataclass(frozen=True)
class Grid:
    """Uniform grid and low-pass that a recording is preprocessed with; ``statement`` says it to people."""

    step: float  # of the grid [s]
    gap: float  # longest time that is interpolated over [s]
    bandwidth: float  # of the motion [Hz]
    source: str  # of the bandwidth, for people
    cutoff: float  # of the low-pass [Hz]
    stride: int  # every so manieth sample of the grid is kept

    @property
    def rate(self) -> float:
        """Rate of the samples that are kept [Hz]."""
        return 1 / (self.step * self.stride)

    @property
    def statement(self) -> str:
        """The grid and the filter in words."""
        return (
            f"resampled to {1 / self.step:.4g} Hz (gaps over {self.gap * 1e3:.3g} ms are not crossed), "
            f"zero-phase low-pass at {self.cutoff:.3g} Hz (bandwidth of the motion "
            f"{self.bandwidth:.3g} Hz, {self.source}), {self.rate:.4g} samples per second kept"
        )


def grid_for(statistics: Statistics, settings: RecordingSettings, sent: float | None = None) -> Grid:
    """Grid of a recording: cut-off by the bandwidth [Hz] of the motion or the commands; rate by it."""
    bandwidth = sent or statistics.bandwidth
    if not bandwidth:
        raise RecordingError(f"{statistics.name}: no joint moves")
    cutoff = min(settings.cutoff or HEADROOM * bandwidth, 0.5 / statistics.step)
    slowest = _LEAST_PERIODS / statistics.duration
    if cutoff <= slowest:
        raise RecordingError(
            f"{statistics.name}: the cut-off is {cutoff:g} Hz, expected more than {slowest:.3g} Hz: of "
            f"{statistics.duration:.4g} s the low-pass leaves nothing"
        )
    return Grid(
        step=statistics.step,
        gap=statistics.gap,
        bandwidth=bandwidth,
        source="of the commands" if sent else "measured",
        cutoff=cutoff,
        stride=max(1, int(1 / (statistics.step * _OVERSAMPLING * cutoff))),
    )


def preprocess(
    recording: Recording,
    settings: RecordingSettings,
    gains: Sequence[float] | None = None,
    sign_width: float = SIGN_WIDTH,
    grid: Grid | None = None,
    delay: float = 0.0,
) -> list[Segment]:
    """Moving stretches of a recording, filtered, on a uniform grid.

    Velocity and acceleration that were not recorded are derivatives of the filtered position and velocity.
    Everything else passes the same filter, so no signal is later than another.

    Drives have gains [N·m/A], one per joint. The smooth sign is at 76 % at a width [rad/s or m/s]. A delay
    [s] by which torques are later than states is taken off. None is the grid of the recording's statistics.
    """
    grid = grid or grid_for(statistics_of(recording, settings), settings)
    signals, factor = _signals(recording, gains, settings.reverse)
    options = {"sign_width": sign_width, "still": settings.still, "delay": delay}
    segments: list[Segment] = []
    for run in runs(recording.time, grid.step, grid.gap):
        kept, *states, moving = _joined(
            _thinned(run, signals, factor, grid, span, **options) for span in _spans(run.points, grid, delay)
        )
        states = [run.time[0] + kept * grid.step, *states]
        segments += [
            Segment(*(np.ascontiguousarray(x[part]) for x in states))
            for part in _stretches(moving & _inside(kept, run.points, grid, delay))
        ]
    if not segments:
        raise RecordingError(
            f"{recording.name}: no joint is ever faster than {settings.still:g} rad/s for a while"
        )
    return segments


def _joined(pieces: Iterable[tuple[NDArray[Any], ...]]) -> list[NDArray[Any]]:
    """Arrays of pieces, one after the other."""
    return [np.concatenate(x) for x in zip(*pieces)]


def _spans(points: int, grid: Grid, delay: float) -> Iterator[tuple[int, int, int, int]]:
    """First and last points of pieces of a run, and of what the filters have to see of it around them."""
    margin = round((max(_FORGOTTEN / grid.cutoff, 2 * _PAUSE) + abs(delay)) / grid.step)
    size = max(_AT_ONCE, 4 * margin)
    for begin in range(0, points, size):
        end = min(points, begin + size)
        yield max(0, begin - margin), begin, end, min(points, end + margin)


def _thinned(
    run: Run,
    signals: Mapping[str, Numbers],
    factor: Numbers,
    grid: Grid,
    span: tuple[int, int, int, int],
    *,
    sign_width: float,
    still: float,
    delay: float,
) -> tuple[NDArray[Any], ...]:
    """Numbers of points of a piece of a run that are kept, (K,), states there, (K, J), and what is moving."""
    first, begin, end, last = span
    x = run.at([*signals.values()], first, last)
    parts = dict(zip(signals, np.split(x, len(signals), 1)))
    parts["torque"] *= factor
    smooth = dict(zip(signals, np.split(low_pass(x, grid.cutoff, grid.step), len(signals), 1)))
    if delay:
        by = (-delay / grid.step, 0.0)
        smooth["torque"] = shift(smooth["torque"], by, order=3, mode="nearest")
    velocity = smooth["velocity"] if "velocity" in smooth else derivative(smooth["position"], grid.step)
    acceleration = smooth["acceleration"] if "acceleration" in smooth else derivative(velocity, grid.step)
    sign = low_pass(np.tanh(velocity / sign_width), grid.cutoff, grid.step)
    states = smooth["position"], velocity, acceleration, smooth["torque"], sign
    kept = np.arange(-(-begin // grid.stride) * grid.stride, end, grid.stride)
    return kept, *(one[kept - first] for one in (*states, _moving(velocity, grid, still)))


def torque_of(recording: Recording, gains: Sequence[float] | None, reverse: Sequence[str]) -> Numbers:
    """Torque [N·m or N] of samples, (S, J), as recorded or from the current."""
    signals, factor = _signals(recording, gains, reverse)
    return signals["torque"] * factor


def _signals(
    recording: Recording, gains: Sequence[float] | None, reverse: Sequence[str]
) -> tuple[dict[str, Numbers], Numbers]:
    """Signals (S, J) that count, and factors (J,) to what is the torque among them, or the current."""
    names = recording.joint_names
    signals = recording.signals()
    factor = np.array([-1.0 if name in reverse else 1.0 for name in names])
    if recording.load == "current":
        if gains is None:
            raise RecordingError(
                f"{recording.name} has currents and no torque; give the drive gains [N·m/A] as robot.gains"
            )
        if len(gains) != len(names):
            raise RecordingError(
                f"robot.gains has {counted(len(gains), 'drive gain')}, the arm has "
                f"{counted(len(names), 'joint')}"
            )
        factor *= gains
    if unknown := [name for name in reverse if name not in names]:
        raise RecordingError(f"reverse names {', '.join(unknown)}; the arm has joints {', '.join(names)}")
    signals["torque"] = signals[recording.load]
    return {name: x for name, x in signals.items() if name != "current"}, factor


def _moving(velocity: Numbers, grid: Grid, still: float) -> NDArray[np.bool_]:
    """Which points are near a motion, (S,), of their velocities (S, J)."""
    if not still:
        return np.ones(len(velocity), dtype=bool)
    fast = np.abs(velocity).max(1) > still
    return np.asarray(maximum_filter1d(fast, 2 * round(_PAUSE / grid.step) + 1), dtype=bool)


def _inside(kept: NDArray[np.int64], points: int, grid: Grid, delay: float) -> NDArray[np.bool_]:
    """Which points of a run the filter can see around, and have a torque without the delay."""
    edge = round(max(2 / grid.cutoff, abs(delay)) / grid.step)
    return (kept >= edge) & (kept < points - edge)


def _stretches(moving: NDArray[np.bool_]) -> Iterator[slice]:
    """Kept points of a run in stretches that move."""
    edges = np.flatnonzero(np.diff(np.pad(moving, 1)))
    for begin, end in zip(edges[::2], edges[1::2]):
        if end - begin >= _LEAST_POINTS:
            yield slice(begin, end)
