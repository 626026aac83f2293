"""Preprocessing of raw recordings to filtered states and torques on a uniform grid."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.ndimage import maximum_filter1d, shift

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.base.settings_text import setting_name
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.grid import Grid, Stretch, continuous_stretches, derivative, low_pass, marked_ranges
from sidegan.recording.recording import SIGN_WIDTH, Recording, Segment
from sidegan.recording.settings import RecordingSettings
from sidegan.recording.statistics import HEADROOM, Statistics, statistics_of

_OVERSAMPLING = 10.0  # samples kept per cut-off period
_AT_ONCE = 50_000  # grid points filtered at once
_FORGOTTEN = 20.0  # cut-off periods after which the filter's response is below 1e-12
_PAUSE = 0.1  # [s] around a motion in which samples are kept
_LEAST_POINTS = 8  # of a segment


def grid_for(statistics: Statistics, settings: RecordingSettings, sent: float | None = None) -> Grid:
    """Grid of a recording; its cut-off follows from the bandwidth [Hz] of the motion, or of what was sent."""
    bandwidth = sent or statistics.bandwidth
    if not bandwidth:
        raise RecordingError(f"{statistics.name}: no joint moves")
    cutoff = min(settings.cutoff or HEADROOM * bandwidth, 0.5 / statistics.step)
    slowest = thresholds.LEAST_PERIODS / statistics.duration
    if cutoff <= slowest:
        raise RecordingError(
            f"{statistics.name}: the cut-off is {cutoff:g} Hz, expected more than {slowest:.3g} Hz: the "
            f"low-pass leaves nothing of {statistics.duration:.4g} s"
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
    All recorded signals pass the same filter, so none is delayed against another.

    ``gains`` are the drives' [N·m/A], one per joint. At ``sign_width`` [rad/s or m/s] the smooth sign is at
    76 %. ``delay`` is that of torques behind states [s], and is removed. The default grid is ``grid_for``.
    """
    grid = grid or grid_for(statistics_of(recording, settings), settings)
    signals, factors = _signals(recording, gains, settings)
    edge = round(max(2 / grid.cutoff, abs(delay)) / grid.step)  # points distorted at the ends
    segments: list[Segment] = []
    for stretch in continuous_stretches(recording.time, grid.step, grid.gap):
        pieces = [
            _thinned(stretch, signals, factors, grid, span, sign_width, settings.still, delay)
            for span in _spans(stretch.points, grid, delay)
        ]
        kept, moving, *states = (np.concatenate(x) for x in zip(*pieces))
        moving &= (kept >= edge) & (kept < stretch.points - edge)
        times = stretch.time[0] + kept * grid.step
        for begin, end in zip(*marked_ranges(moving)):
            if end - begin >= _LEAST_POINTS:
                segments.append(Segment(*(np.ascontiguousarray(x[begin:end]) for x in (times, *states))))
    if not segments:
        raise RecordingError(
            f"{recording.name}: no stretch without gaps, in which a joint stays faster than "
            f"{settings.still:g} rad/s or m/s, is long enough"
        )
    return segments


def _spans(points: int, grid: Grid, delay: float) -> Iterator[tuple[int, int, int, int]]:
    """Pieces of a stretch: first point with the filter's margin, first and last point, last with margin."""
    margin = round((max(_FORGOTTEN / grid.cutoff, 2 * _PAUSE) + abs(delay)) / grid.step)
    size = max(_AT_ONCE, 4 * margin)
    for begin in range(0, points, size):
        end = min(points, begin + size)
        yield max(0, begin - margin), begin, end, min(points, end + margin)


def _thinned(
    stretch: Stretch,
    signals: Mapping[str, Array],
    factors: Array,
    grid: Grid,
    span: tuple[int, int, int, int],
    sign_width: float,
    still: float,
    delay: float,
) -> tuple[Array, ...]:
    """A piece's kept points, (K,), whether they are near a motion, (K,), and states, (K, J) each."""
    first, begin, end, last = span
    x = low_pass(stretch.at([*signals.values()], first, last), grid.cutoff, grid.step)
    smooth = dict(zip(signals, np.split(x, len(signals), 1)))
    torque = smooth["torque"] @ factors.T
    if delay:
        torque = shift(torque, (-delay / grid.step, 0.0), order=3, mode="nearest")
    velocity = smooth["velocity"] if "velocity" in smooth else derivative(smooth["position"], grid.step)
    acceleration = smooth["acceleration"] if "acceleration" in smooth else derivative(velocity, grid.step)
    sign = low_pass(np.tanh(velocity / sign_width), grid.cutoff, grid.step)
    fast = np.abs(velocity).max(1) >= still
    moving = maximum_filter1d(fast, 2 * round(_PAUSE / grid.step) + 1)
    kept = np.arange(-(-begin // grid.stride) * grid.stride, end, grid.stride)
    states = smooth["position"], velocity, acceleration, torque, sign
    return kept, *(x[kept - first] for x in (moving, *states))


def torque_of(recording: Recording, gains: Sequence[float] | None, settings: RecordingSettings) -> Array:
    """Torque [N·m or N] of all samples, (S, J), of the joints, from recorded torques or currents."""
    signals, factors = _signals(recording, gains, settings)
    return signals["torque"] @ factors.T


def _signals(
    recording: Recording, gains: Sequence[float] | None, settings: RecordingSettings
) -> tuple[dict[str, Array], Array]:
    """Signals (S, J), with torques or currents as ``torque``, and the matrix (J, J) from these to torques."""
    reverse, names = settings.reverse, recording.joint_names
    signals = recording.signals()
    factor = np.array([-1.0 if name in reverse else 1.0 for name in names])
    if recording.load == "current":
        if gains is None:
            raise RecordingError(
                f"{recording.name} has currents but no torque; set the drive gains [N·m/A] by "
                f"{setting_name('robot.gains')}"
            )
        if len(gains) != len(names):
            raise RecordingError(
                f"{setting_name('robot.gains')} has {counted(len(gains), 'drive gain')}, the arm has "
                f"{counted(len(names), 'joint')}"
            )
        factor *= gains
    if unknown := [name for name in reverse if name not in names]:
        raise RecordingError(
            f"recording.reverse names {', '.join(unknown)}; the arm has joints {', '.join(names)}"
        )
    signals["torque"] = signals.pop(recording.load)
    signals.pop("current", None)
    return signals, settings.torque_matrix(names) * factor
