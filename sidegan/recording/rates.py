"""Recorded velocities and accelerations beside the derivatives of what they are rates of."""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording.recording import SIGN_WIDTH, Segment
from sidegan.recording.refused import DEGREES
from sidegan.robot import Arm

RATES = {"velocity": "position", "acceleration": "velocity"}  # what is the rate of what
_MOVING = 10 * SIGN_WIDTH  # root mean square [rad/s] of a rate from which on it is compared
_WRONG = 1.1  # times the derivative, or a part of it
_ALIKE = 0.5  # correlation with the derivative below which it is another signal
_SAME = 0.95  # correlation from which on it is that one
_NEAR = 0.3  # of the logarithm of a ratio
_TINY = 1e-12


def contradiction(file: str, arm: Arm, rate: str, segments: list[Segment]) -> str | None:
    """What is wrong with a recorded rate, a sentence; None where it is the derivative that it should be.

    Noise of either only makes it look smaller than the derivative, or the derivative smaller than it.

    Raises:
        RecordingError: when it is that of another unit of angles.
    """
    derived, recorded = (np.concatenate(x) for x in zip(*(_both(segment, rate) for segment in segments)))
    moving = np.maximum(*(np.sqrt(np.square(x).mean(0)) for x in (derived, recorded))) > _MOVING
    products, own, other = (x.sum(0) for x in (derived * recorded, np.square(derived), np.square(recorded)))
    slope, inverse = products / np.maximum(own, _TINY), products / np.maximum(other, _TINY)
    alike = products / np.maximum(np.sqrt(own * other), _TINY)
    for j in np.flatnonzero(moving).tolist():
        ratio = abs(slope[j])
        if abs(abs(math.log(max(ratio, _TINY))) - math.log(DEGREES)) < _NEAR and abs(alike[j]) > _ALIKE:
            raise RecordingError(
                f"{file}: the {rate} of {arm.joint_names[j]} is {ratio:.3g} times the derivative of its "
                f"{RATES[rate]}: one of them is in degrees and the other in radians"
            )
    wrong = moving & ((alike < _ALIKE) | (slope > _WRONG) | (inverse > _WRONG))
    if not wrong.any():
        return None
    which = np.flatnonzero(wrong).tolist()
    each = [f"{slope[j]:.2f} ({arm.joint_names[j]}{_other(arm, derived, recorded, j)})" for j in which]
    return (
        f"the {rate} is {', '.join(each)} times the derivative of the {RATES[rate]}, and is not used but "
        f"derived: were columns exchanged, scaled or reversed? (recording.{rate}=null takes this line away)"
    )


def _other(arm: Arm, derived: Array, recorded: Array, j: int) -> str:
    """The joint whose derivative a joint's recorded rate is, in words, if it is another one's."""
    one = recorded[:, j]
    sizes = np.linalg.norm(derived, axis=0) * np.linalg.norm(one)
    alike = one @ derived / np.maximum(sizes, _TINY)
    k = int(alike.argmax())
    return f": it is that of {arm.joint_names[k]}" if k != j and alike[k] > _SAME else ""


def _both(segment: Segment, rate: str) -> tuple[Array, Array]:
    """Central difference of what a segment's rate is one of, and that rate there."""
    step, of = float(segment.time[1] - segment.time[0]), getattr(segment, RATES[rate])
    return (of[2:] - of[:-2]) / (2 * step), getattr(segment, rate)[1:-1]
