"""Disturbances of a recording, from a model's residuals: contacts, and torque sensors that drift."""

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.identification.fit import residual_of
from sidegan.identification.identified import IdentifiedArm, measurements_of
from sidegan.identification.measurements import pieces

_WINDOWS = 12  # equal parts of a recording
_LEAST = 10  # samples of a part
_BEYOND = 4.0  # times the median part's residual: a contact
_LINEAR = 0.7  # share of a residual's variance that a straight line explains if the sensor drifts
_ALIKE = 0.5  # share of time that positions explain, from which drifts and errors of the model look alike
_TINY = 1e-12


def disturbances(found: IdentifiedArm) -> list[str]:
    """Remarks on contacts and drifts in an identified arm's recordings."""
    arm = found.model.arm
    remarks = []
    for recording in found.recordings:
        time, position, velocity, *_ = (np.concatenate(x) for x in zip(*recording.segments))
        if len(time) < _WINDOWS * _LEAST:
            continue
        parts = pieces(measurements_of([recording]))
        left = np.concatenate([residual_of(found.model, x, found.chosen.parameters) for x in parts])
        begin, end, sizes, far = _contact(time, velocity, left)
        if far.any():
            remarks.append(
                f"from {begin:.3g} s to {end:.3g} s of {recording.name} the residual of {arm.named(far)} is "
                f"{sizes.max():.2g} times that of the rest: did the arm touch something? cut these rows"
            )
        changes = _drift(time, position, left)
        drifts = [f"{arm.joint_names[j]} by {changes[j]:.2g}" for j in np.flatnonzero(changes)]
        if drifts:
            remarks.append(
                f"through {recording.name} the torque drifts, of {listed(drifts)} N·m or N: does a sensor "
                "warm up? record when it is warm, or tare it between shorter recordings"
            )
    return remarks


def _contact(time: Array, velocity: Array, residual: Array) -> tuple[float, float, Array, Array]:
    """Times of the part whose residuals, (S, J), are largest, how large, and which are far too large, (J,).

    Relative to those of the median part, and to the velocity: a model's own errors grow with the motion.
    """
    sizes, speeds = (_relative(x) for x in (residual, velocity))
    excess = sizes / np.maximum(speeds, 1.0)
    worst = int(excess.max(1).argmax())
    begin, end = np.array_split(time, _WINDOWS)[worst][[0, -1]]
    return begin, end, sizes[worst], excess[worst] > _BEYOND


def _drift(time: Array, position: Array, residual: Array) -> Array:
    """Changes of residuals, (S, J), along a straight line in time, (J,); 0 if they do not, or motion does."""
    away = time - time.mean()
    motion = position - position.mean(0)
    if np.square(motion @ np.linalg.lstsq(motion, away)[0]).sum() > _ALIKE * (away @ away):
        return np.zeros(residual.shape[1])
    slope = away @ residual / (away @ away)
    variance = np.maximum(len(time) * residual.var(0), _TINY)
    drifting = np.square(slope) * (away @ away) / variance > _LINEAR
    return np.where(drifting, slope * (time[-1] - time[0]), 0.0)


def _relative(x: Array) -> Array:
    """Root mean square of (S, J) in each part of a recording, over that of the median part, (W, J)."""
    sizes = np.stack([np.sqrt(np.square(part).mean(0)) for part in np.array_split(x, _WINDOWS)])
    return sizes / np.maximum(np.median(sizes, 0), _TINY)
