"""From raw recordings to filtered states and torques on a uniform grid."""

from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from sidegan.errors import RecordingError
from sidegan.recording.filters import derivative, low_pass, windows
from sidegan.recording.grid import Block, uniform
from sidegan.recording.raw import Survey, survey
from sidegan.recording.recording import SIGNALS, Recording, Segment
from sidegan.recording.settings import Grid, Settings
from sidegan.recording.tables import Numbers

_POINTS_AT_ONCE = 65_536
_LEAST_POINTS = 8  # of a segment


def grid_for(known: Survey, settings: Settings) -> Grid:
    """What a recording is conditioned with: cut-off from the motion's bandwidth, rate from the cut-off.

    Raises:
        RecordingError: when the arm does not move, or the bandwidth is not below half the sampling rate.
    """
    bandwidth = settings.bandwidth or known.bandwidth
    if not bandwidth:
        raise RecordingError(f"{known.name}: no joint moves")
    half = 0.5 / known.step
    if bandwidth >= half:
        raise RecordingError(
            f"{known.name}: the bandwidth is {bandwidth:g} Hz, expected less than half the rate, "
            f"{half:.4g} Hz"
        )
    cutoff = min(settings.cutoff or settings.headroom * bandwidth, half)
    stride = max(1, int(1 / (known.step * settings.oversampling * cutoff)))
    measured = settings.bandwidth is None
    return Grid(known.step, known.gap, bandwidth, measured, cutoff, settings.order, stride)


def condition(
    recording: Recording | Iterable[Recording], settings: Settings | None = None, grid: Grid | None = None
) -> list[Segment]:
    """Moving stretches of a recording, filtered, on a uniform grid.

    Velocity and acceleration that were not recorded are derivatives of the filtered position and velocity.
    Everything else passes the same filter, so no signal is later than another. Memory holds one piece
    of the recording and what is kept of the others.

    Args:
        recording: whole, or consecutive pieces that can be walked through twice.
        settings: what may be chosen.
        grid: what was found out about the recording already; then it is walked through once.

    Raises:
        RecordingError: when there is no torque, or no motion.
    """
    settings = settings or Settings()
    if grid is None:
        grid = grid_for(survey(recording, settings.gap), settings)
    parts = iter([recording] if isinstance(recording, Recording) else recording)
    first = next(parts, None)
    if first is None:
        raise RecordingError("the recording holds no samples")
    found = _merged(_segments(first, parts, settings, grid), 1.5 * grid.step * grid.stride)
    long_enough = [segment for segment in found if len(segment.time) >= _LEAST_POINTS]
    if not long_enough:
        raise RecordingError(
            f"{first.name}: no joint is ever faster than {settings.still:g} rad/s for a while"
        )
    return long_enough


def _segments(
    first: Recording, others: Iterable[Recording], settings: Settings, grid: Grid
) -> Iterator[Segment]:
    """Stretches that are to be kept, of consecutive pieces of one recording."""
    widths = {name: x.shape[1] for name, x in _used(first, settings).items()}
    pieces = (
        (part.time.numpy(), np.concatenate(list(_used(part, settings).values()), 1))
        for part in chain([first], others)
    )
    halo = grid.halo + round(settings.pause / grid.step)
    least = max(_POINTS_AT_ONCE, 2 * halo)
    for window, core, last in windows(uniform(pieces, grid.step, grid.gap), halo, least):
        yield from _conditioned(window, core, last, widths, settings, grid)


def _used(part: Recording, settings: Settings) -> dict[str, Numbers]:
    """The signals that count, (S, J) each, in ``SIGNALS``' order; torque from current where it has to be."""
    found = {name: x.numpy() for name, x in part.signals().items()}
    current = found.pop("current", None)
    if "torque" not in found:
        if current is None:
            raise RecordingError(f"{part.name} has neither torque nor current")
        if settings.gains is None:
            raise RecordingError(
                f"{part.name} has currents and no torque; give the drive gains [N·m/A] as robot.gains"
            )
        if len(settings.gains) != len(part.joint_names):
            raise RecordingError(
                f"there are {len(settings.gains)} drive gains, the arm has {len(part.joint_names)} joints"
            )
        found["torque"] = current * np.array(settings.gains)
    found["torque"] = found["torque"] * _signs(part.joint_names, settings.reverse)
    return {name: found[name] for name in SIGNALS if name in found}


def _signs(joint_names: tuple[str, ...], reverse: tuple[str, ...]) -> Numbers:
    unknown = [name for name in reverse if name not in joint_names]
    if unknown:
        raise RecordingError(
            f"reverse names {', '.join(unknown)}; the arm has joints {', '.join(joint_names)}"
        )
    return np.array([-1.0 if name in reverse else 1.0 for name in joint_names])


def _conditioned(
    window: Block, core: slice, last: bool, widths: dict[str, int], settings: Settings, grid: Grid
) -> Iterator[Segment]:
    """What is kept of a window's core, cut where the arm rests."""
    smooth = low_pass(window.signals, grid.cutoff, grid.step, grid.order)
    found = dict(zip(widths, np.split(smooth, np.cumsum(list(widths.values()))[:-1], axis=1)))
    velocity = found["velocity"] if "velocity" in found else derivative(found["position"], grid.step)
    acceleration = found["acceleration"] if "acceleration" in found else derivative(velocity, grid.step)
    index = np.arange(window.first, window.first + len(window.time))
    stays = _moving(velocity, settings, grid) & (index >= grid.edge)
    if last:
        stays[max(0, len(stays) - grid.edge) :] = False
    kept = np.arange(len(index))[core]
    kept = kept[index[kept] % grid.stride == 0]  # the same points wherever a window begins
    sign = low_pass(np.tanh(velocity / settings.sign_width), grid.cutoff, grid.step, grid.order)
    signals = (window.time, found["position"], velocity, acceleration, found["torque"], sign)
    for part in np.split(kept, np.flatnonzero(np.diff(stays[kept])) + 1):
        if len(part) and stays[part[0]]:
            yield Segment(*(torch.from_numpy(np.ascontiguousarray(x[part])) for x in signals))


def _moving(velocity: Numbers, settings: Settings, grid: Grid) -> NDArray[np.bool_]:
    """Whether any joint moves near a sample, (S,)."""
    if not settings.still:
        return np.ones(len(velocity), dtype=bool)
    fast = np.abs(velocity).max(1) > settings.still
    return np.asarray(maximum_filter1d(fast, 2 * round(settings.pause / grid.step) + 1), dtype=bool)


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
