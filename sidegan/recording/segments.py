"""Preprocessing: from raw recordings to filtered states and torques on a uniform grid."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, shift

from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording.grid import derivative, low_pass, uniform
from sidegan.recording.recording import SIGN_WIDTH, Recording, Segment
from sidegan.recording.settings import RecordingSettings
from sidegan.recording.statistics import HEADROOM, Statistics, statistics_of
from sidegan.recording.tables import Numbers

_OVERSAMPLING = 10.0  # samples that are kept per period of the cut-off
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
    """Grid of a recording: cut-off from the bandwidth [Hz] of the motion, or of what was sent; rate from it.

    Raises:
        RecordingError: when the arm does not move, or the cut-off is so low that nothing is left.
    """
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
        source="of what was sent" if sent else "measured",
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

    Raises:
        RecordingError: when there is no torque, or no motion.
    """
    grid = grid or grid_for(statistics_of(recording, settings), settings)
    signals = signals_of(recording, gains, settings.reverse)
    segments: list[Segment] = []
    columns = np.concatenate([*signals.values()], 1)
    for time, x in uniform(recording.time.numpy(), columns, grid.step, grid.gap):
        smooth = low_pass(x, grid.cutoff, grid.step)
        run = dict(zip(signals, np.split(smooth, len(signals), 1)))
        if delay:
            run["torque"] = shift(run["torque"], (-delay / grid.step, 0.0), order=3, mode="nearest")
        velocity = run["velocity"] if "velocity" in run else derivative(run["position"], grid.step)
        acceleration = run["acceleration"] if "acceleration" in run else derivative(velocity, grid.step)
        sign = low_pass(np.tanh(velocity / sign_width), grid.cutoff, grid.step)
        states = time, run["position"], velocity, acceleration, run["torque"], sign
        segments += [
            Segment(*(torch.from_numpy(np.ascontiguousarray(x[part])) for x in states))
            for part in _kept(velocity, grid, settings.still, delay)
        ]
    if not segments:
        raise RecordingError(
            f"{recording.name}: no joint is ever faster than {settings.still:g} rad/s for a while"
        )
    return segments


def signals_of(
    recording: Recording, gains: Sequence[float] | None, reverse: Sequence[str]
) -> dict[str, Numbers]:
    """Signals (S, J) that count; torque from current where it has to be."""
    names = recording.joint_names
    signals = {name: x.numpy() for name, x in recording.signals().items()}
    load = signals[recording.load]
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
        load = load * np.array(gains)
    if unknown := [name for name in reverse if name not in names]:
        raise RecordingError(f"reverse names {', '.join(unknown)}; the arm has joints {', '.join(names)}")
    signals["torque"] = load * [-1.0 if name in reverse else 1.0 for name in names]
    return {name: x for name, x in signals.items() if name != "current"}


def _kept(velocity: Numbers, grid: Grid, still: float, delay: float) -> Iterator[NDArray[np.int64]]:
    """Indices of stretches of a run that are kept, of its velocities (S, J): every stride near motion."""
    moving = np.ones(len(velocity), dtype=bool)
    if still:
        fast = np.abs(velocity).max(1) > still
        moving = maximum_filter1d(fast, 2 * round(_PAUSE / grid.step) + 1).astype(bool)
    # samples at either end that the filter cannot see around, or that have no torque without the delay
    edge = round(max(2 / grid.cutoff, abs(delay)) / grid.step)
    moving[:edge] = False
    moving[max(0, len(moving) - edge) :] = False
    kept = np.arange(0, len(moving), grid.stride)
    for part in np.split(kept, np.flatnonzero(np.diff(moving[kept])) + 1):
        if len(part) >= _LEAST_POINTS and moving[part[0]]:
            yield part
