"""Preprocessing: from raw recordings to filtered states and torques on a uniform grid."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, shift

from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording.grid import Block, derivative, low_pass, uniform, windows
from sidegan.recording.recording import SIGN_WIDTH, Recording, Segment
from sidegan.recording.settings import SIGNALS, Preprocessing
from sidegan.recording.statistics import Statistics, statistics_of
from sidegan.recording.tables import Numbers

_POINTS_AT_ONCE = 65_536
_LEAST_POINTS = 8  # of a segment
_LEAST_PERIODS = 4.0  # of the cut-off in a recording: as long as the edges of the filter


@dataclass(frozen=True)
class Grid:
    """Uniform grid and low-pass that a recording is preprocessed with; ``statement`` says it to people."""

    step: float  # of the grid [s]
    gap: float  # longest time that is interpolated over [s]
    bandwidth: float  # of the motion [Hz]
    source: Literal["measured", "given", "of what was sent"]  # of the bandwidth
    cutoff: float  # of the low-pass [Hz]
    order: int  # of the low-pass
    stride: int  # every so manieth sample of the grid is kept

    @property
    def rate(self) -> float:
        """Rate of the samples that are kept [Hz]."""
        return 1 / (self.step * self.stride)

    @property
    def halo(self) -> int:
        """Samples around a block after which the filter has forgotten what came before."""
        return round(10 / (self.cutoff * self.step)) + 4

    @property
    def edge(self) -> int:
        """Samples at either end of a stretch without gaps that the filter could not see around."""
        return round(2 / (self.cutoff * self.step))

    @property
    def statement(self) -> str:
        """The grid and the filter in words."""
        return (
            f"resampled to {1 / self.step:.4g} Hz (gaps over {self.gap * 1e3:.3g} ms are not crossed), "
            f"zero-phase low-pass of order {self.order} at {self.cutoff:.3g} Hz (bandwidth of the motion "
            f"{self.bandwidth:.3g} Hz, {self.source}), {self.rate:.4g} samples per second kept"
        )


def grid_for(statistics: Statistics, settings: Preprocessing, sent: float | None = None) -> Grid:
    """Grid of a recording: cut-off from the motion's bandwidth, rate from the cut-off.

    What was sent to the arm may have told the bandwidth [Hz].

    Raises:
        RecordingError: when the arm does not move, or the bandwidth is not below half the sampling rate.
    """
    bandwidth = settings.bandwidth or sent or statistics.bandwidth
    if not bandwidth:
        raise RecordingError(f"{statistics.name}: no joint moves")
    half = 0.5 / statistics.step
    if bandwidth >= half:
        raise RecordingError(
            f"{statistics.name}: the bandwidth is {bandwidth:g} Hz, expected less than half the rate, "
            f"{half:.4g} Hz"
        )
    cutoff = min(settings.cutoff_of(bandwidth), half)
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
        source="given" if settings.bandwidth else "of what was sent" if sent else "measured",
        cutoff=cutoff,
        order=settings.order,
        stride=max(1, int(1 / (statistics.step * settings.oversampling * cutoff))),
    )


def preprocess(
    recording: Recording | Iterable[Recording],
    settings: Preprocessing,
    gains: Sequence[float] | None = None,
    sign_width: float = SIGN_WIDTH,
    grid: Grid | None = None,
    delay: float = 0.0,
) -> list[Segment]:
    """Moving stretches of a recording, filtered, on a uniform grid.

    Velocity and acceleration that were not recorded are derivatives of the filtered position and velocity.
    Everything else passes the same filter, so no signal is later than another. Memory holds one piece
    of the recording and what is kept of the others.

    Args:
        recording: whole, or consecutive pieces that can be walked through twice.
        settings: of the filter and of what is kept.
        gains: of the drives, motor current to joint torque [N·m/A], one per joint.
        sign_width: velocity at which the smooth sign is at 76 % [rad/s or m/s].
        grid: of the recording, where it was found already; then the recording is walked through once.
        delay: time by which torques are later than states [s], which is taken off.

    Raises:
        RecordingError: when there is no torque, or no motion.
    """
    grid = grid or grid_for(statistics_of(recording, settings.gap, settings.bridged), settings)
    parts = iter([recording] if isinstance(recording, Recording) else recording)
    first = next(parts, None)
    if first is None:
        raise RecordingError("the recording holds no samples")
    stretches = _Stretches(settings, grid, sign_width, gains, delay)
    merged = _merged(stretches.of(first, parts), 1.5 * grid.step * grid.stride)
    segments = [segment for segment in merged if len(segment.time) >= _LEAST_POINTS]
    if not segments:
        raise RecordingError(
            f"{first.name}: no joint is ever faster than {settings.still:g} rad/s for a while"
        )
    return segments


@dataclass(frozen=True)
class _Stretches:
    """Stretches of a recording that are kept; attributes as for ``preprocess``."""

    settings: Preprocessing
    grid: Grid
    sign_width: float
    gains: Sequence[float] | None
    delay: float

    def of(self, first: Recording, others: Iterable[Recording]) -> Iterator[Segment]:
        """Stretches that are kept, of consecutive pieces of one recording."""
        grid = self.grid
        widths = {name: x.shape[1] for name, x in self._signals(first).items()}
        pieces = (
            (part.time.numpy(), np.concatenate(list(self._signals(part).values()), 1))
            for part in chain([first], others)
        )
        halo = grid.halo + round(self.settings.pause / grid.step)
        least = max(_POINTS_AT_ONCE, 2 * halo)
        for window, core, last in windows(uniform(pieces, grid.step, grid.gap), halo, least):
            yield from self._filtered(window, core, last, widths)

    def _signals(self, part: Recording) -> dict[str, Numbers]:
        """Signals (S, J) that count, in ``SIGNALS``' order; torque from current where it has to be."""
        signals = {name: x.numpy() for name, x in part.signals().items()}
        current = signals.pop("current", None)
        if "torque" not in signals:
            if current is None:
                raise RecordingError(f"{part.name} has neither torque nor current")
            signals["torque"] = current * self._gains(part)
        signals["torque"] = signals["torque"] * _directions(part.joint_names, self.settings.reverse)
        return {name: signals[name] for name in SIGNALS if name in signals}

    def _gains(self, part: Recording) -> Numbers:
        """Drive gains [N·m/A], (J,)."""
        if self.gains is None:
            raise RecordingError(
                f"{part.name} has currents and no torque; give the drive gains [N·m/A] as robot.gains"
            )
        if len(self.gains) != len(part.joint_names):
            raise RecordingError(
                f"robot.gains has {counted(len(self.gains), 'drive gain')}, the arm has "
                f"{counted(len(part.joint_names), 'joint')}"
            )
        return np.array(self.gains)

    def _filtered(self, window: Block, core: slice, last: bool, widths: dict[str, int]) -> Iterator[Segment]:
        """What is kept of a window's core, cut where the arm rests."""
        grid = self.grid
        smooth = low_pass(window.signals, grid.cutoff, grid.step, grid.order)
        signals = dict(zip(widths, np.split(smooth, np.cumsum(list(widths.values()))[:-1], axis=1)))
        if self.delay:
            late = self.delay / grid.step  # in samples
            signals["torque"] = shift(signals["torque"], (-late, 0.0), order=3, mode="nearest")
        velocity = signals["velocity"] if "velocity" in widths else derivative(signals["position"], grid.step)
        acceleration = (
            signals["acceleration"] if "acceleration" in widths else derivative(velocity, grid.step)
        )
        index = np.arange(window.first, window.first + len(window.time))
        stays = self._moving(velocity) & (index >= grid.edge)
        if last:
            stays[max(0, len(stays) - grid.edge) :] = False
        kept = np.arange(len(index))[core]
        kept = kept[index[kept] % grid.stride == 0]  # the same points wherever a window begins
        sign = low_pass(np.tanh(velocity / self.sign_width), grid.cutoff, grid.step, grid.order)
        columns = (window.time, signals["position"], velocity, acceleration, signals["torque"], sign)
        for part in np.split(kept, np.flatnonzero(np.diff(stays[kept])) + 1):
            if len(part) and stays[part[0]]:
                yield Segment(*(torch.from_numpy(np.ascontiguousarray(x[part])) for x in columns))

    def _moving(self, velocity: Numbers) -> NDArray[np.bool_]:
        """Whether any joint moves near a sample, (S,)."""
        if not self.settings.still:
            return np.ones(len(velocity), dtype=bool)
        fast = np.abs(velocity).max(1) > self.settings.still
        width = 2 * round(self.settings.pause / self.grid.step) + 1
        return np.asarray(maximum_filter1d(fast, width), dtype=bool)


def _directions(joint_names: Sequence[str], reverse: Sequence[str]) -> Numbers:
    """Minus one for joints whose torque is counted the other way round, else one, (J,)."""
    unknown = [name for name in reverse if name not in joint_names]
    if unknown:
        raise RecordingError(
            f"reverse names {', '.join(unknown)}; the arm has joints {', '.join(joint_names)}"
        )
    return np.array([-1.0 if name in reverse else 1.0 for name in joint_names])


def _merged(segments: Iterable[Segment], most: float) -> Iterator[Segment]:
    """Segments of which no two follow each other within ``most`` [s]: pieces leave no seams."""
    pieces: list[Segment] = []
    for segment in segments:
        if pieces and float(segment.time[0] - pieces[-1].time[-1]) > most:
            yield Segment(*(torch.cat(x) for x in zip(*pieces)))
            pieces = []
        pieces.append(segment)
    if pieces:
        yield Segment(*(torch.cat(x) for x in zip(*pieces)))
