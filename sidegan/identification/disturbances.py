"""Disturbances of a recording, from a model's residuals: contacts, and torque sensors that drift."""

from collections.abc import Iterator

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.identification.gather import residual_of
from sidegan.identification.identified import IdentifiedArm, measurements_of
from sidegan.identification.measurements import pieces
from sidegan.recording.check import CheckedRecording

_WINDOWS = 12  # equal parts of a recording
_LEAST = 10  # samples of a part
_BEYOND = 4.0  # times the median part's residual: a contact
_LINEAR = 0.7  # share of a residual's variance that a straight line explains if the sensor drifts
_ALIKE = 0.5  # share of time that positions explain, from which drifts and errors of the model look alike
_TINY = 1e-12


def disturbances(found: IdentifiedArm) -> list[str]:
    """Remarks on contacts and drifts in an identified arm's recordings."""
    return [text for recording in found.recordings for text in _of(found, recording)]


def _of(found: IdentifiedArm, recording: CheckedRecording) -> Iterator[str]:
    arm = found.model.arm
    time = np.concatenate([segment.time for segment in recording.segments])
    if len(time) < _WINDOWS * _LEAST:
        return
    parts = [*pieces(measurements_of([recording]))]
    residual = np.concatenate([residual_of(found.model, part, found.chosen.parameters) for part in parts])
    velocity = np.concatenate([part.velocity for part in parts])
    sizes, speeds = (_relative(x) for x in (residual, velocity))
    # a model's own errors grow with the motion: parts with more of it may have larger residuals
    excess = sizes / np.maximum(speeds, 1.0)
    worst = int(excess.max(1).argmax())
    if (far := excess[worst] > _BEYOND).any():
        begin, end = np.array_split(time, _WINDOWS)[worst][[0, -1]]
        yield (
            f"from {begin:.3g} s to {end:.3g} s of {recording.name} the residual of {arm.named(far)} is "
            f"{sizes[worst].max():.2g} times that of the rest: did the arm touch something? cut these rows"
        )
    away = time - time.mean()
    motion = np.concatenate([part.position for part in parts])
    motion = motion - motion.mean(0)
    if np.square(motion @ np.linalg.lstsq(motion, away)[0]).sum() > _ALIKE * (away @ away):
        return
    slope = away @ residual / (away @ away)
    line = np.square(slope) * (away @ away) / np.maximum(len(time) * residual.var(0), _TINY)
    if (line > _LINEAR).any():
        drifts = zip(arm.joint_names, (slope * (time[-1] - time[0])).tolist(), line > _LINEAR)
        shares = [f"{name} by {drift:.2g}" for name, drift, drifting in drifts if drifting]
        yield (
            f"through {recording.name} the torque drifts, of {listed(shares)} N·m or N: does a sensor warm "
            "up? record when it is warm, or tare it between shorter recordings"
        )


def _relative(x: Array) -> Array:
    """Root mean square of (S, J) in each part of a recording, over that of the median part, (W, J)."""
    sizes = np.stack([np.sqrt(np.square(part).mean(0)) for part in np.array_split(x, _WINDOWS)])
    return sizes / np.maximum(np.median(sizes, 0), _TINY)
