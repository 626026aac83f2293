"""Disturbances of a recording, from a model's residuals: contacts, and torque sensors that drift."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.identification.gather import residual_of
from sidegan.identification.identified import IdentifiedArm, measurements_of
from sidegan.identification.measurements import pieces
from sidegan.recording.check import CheckedRecording
from sidegan.robot import Arm

_WINDOWS = 12  # equal parts of a recording
_LEAST = 10  # samples of a part
_BEYOND = 4.0  # times the median part's residual: a contact
_LINEAR = 0.7  # share of a residual's variance that a straight line explains if the sensor drifts
_ALIKE = 0.5  # share of time that positions explain, from which drifts and errors of the model look alike
_TINY = 1e-12


def disturbances(found: IdentifiedArm) -> list[str]:
    """Remarks on contacts and drifts in an identified arm's recordings."""
    residuals = [_Residual.of(found, recording) for recording in found.recordings]
    long = [residual for residual in residuals if len(residual.time) >= _WINDOWS * _LEAST]
    return [text for residual in long for text in (residual.contact(), residual.drift()) if text]


@dataclass(frozen=True)
class _Residual:
    """A recording, and what the model leaves of its torques, (S, J)."""

    name: str
    arm: Arm
    time: Array  # [s], (S,)
    position: Array  # (S, J)
    velocity: Array  # (S, J)
    torque: Array  # measured less modelled [N·m or N], (S, J)

    @classmethod
    def of(cls, found: IdentifiedArm, recording: CheckedRecording) -> "_Residual":
        """That of an identified arm's recommended model."""
        parts = [*pieces(measurements_of([recording]))]
        model, parameters = found.model, found.chosen.parameters
        return cls(
            recording.name,
            model.arm,
            np.concatenate([segment.time for segment in recording.segments]),
            np.concatenate([part.position for part in parts]),
            np.concatenate([part.velocity for part in parts]),
            np.concatenate([residual_of(model, part, parameters) for part in parts]),
        )

    def contact(self) -> str | None:
        """A remark on a part with far larger residuals than the others, which no faster motion explains."""
        sizes, speeds = (_relative(x) for x in (self.torque, self.velocity))
        # a model's own errors grow with the motion: parts with more of it may have larger residuals
        excess = sizes / np.maximum(speeds, 1.0)
        worst = int(excess.max(1).argmax())
        far = excess[worst] > _BEYOND
        if not far.any():
            return None
        begin, end = np.array_split(self.time, _WINDOWS)[worst][[0, -1]]
        return (
            f"from {begin:.3g} s to {end:.3g} s of {self.name} the residual of {self.arm.named(far)} is "
            f"{sizes[worst].max():.2g} times that of the rest: did the arm touch something? cut these rows"
        )

    def drift(self) -> str | None:
        """A remark on residuals along a straight line in time, unless the motion looks like one."""
        away = self.time - self.time.mean()
        motion = self.position - self.position.mean(0)
        if np.square(motion @ np.linalg.lstsq(motion, away)[0]).sum() > _ALIKE * (away @ away):
            return None
        slope = away @ self.torque / (away @ away)
        variance = np.maximum(len(self.time) * self.torque.var(0), _TINY)
        drifting = np.square(slope) * (away @ away) / variance > _LINEAR
        if not drifting.any():
            return None
        changes = slope * (self.time[-1] - self.time[0])
        drifts = [f"{self.arm.joint_names[j]} by {changes[j]:.2g}" for j in np.flatnonzero(drifting)]
        return (
            f"through {self.name} the torque drifts, of {listed(drifts)} N·m or N: does a sensor warm up? "
            "record when it is warm, or tare it between shorter recordings"
        )


def _relative(x: Array) -> Array:
    """Root mean square of (S, J) in each part of a recording, over that of the median part, (W, J)."""
    sizes = np.stack([np.sqrt(np.square(part).mean(0)) for part in np.array_split(x, _WINDOWS)])
    return sizes / np.maximum(np.median(sizes, 0), _TINY)
