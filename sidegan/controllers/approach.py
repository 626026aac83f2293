"""The way from where an arm stands to where its trajectories begin, and back: straight, from rest to rest."""

from collections.abc import Sequence

import torch
from torch import Tensor

from sidegan.controllers.course import Course
from sidegan.errors import InfeasibleError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.validity import Constraints
from sidegan.validity.straight import require_straight

# Largest velocity, acceleration and jerk of the quintic from 0 to 1 in unit time that rests at both ends.
_PEAKS = (15 / 8, 10 / 3**0.5, 60.0)
_POINTS = 40  # of the course, at which torques are looked at
_HOLDABLE = 0.999  # share of a torque limit that holds the arm, beyond which there is nothing left to move it
_ROUNDING = 1 + 1e-9
_SHORTEST = 0.5  # [s]
_CLOSER = "bring the arm closer to home by hand or by its own planner first"


def approach(constraints: Constraints, start: Sequence[float], home: Sequence[float], use: float) -> Course:
    """A course from one configuration [rad or m] to another on the straight way between them.

    The joints move in step, on a quintic in time; the duration is the shortest, half a second at least, in
    which no joint uses more than this share of its limits: of torque, to move the arm, beside what holds it.

    Raises:
        ShapeError: when an end is not one finite number per joint.
        InfeasibleError: when the straight way is not free, or a joint cannot hold the arm on it, and what to
            do.
    """
    arm = constraints.arm
    try:
        require_straight(constraints, start, home)
    except InfeasibleError as error:
        raise InfeasibleError(f"{error}; {_CLOSER}, then say where it is") from error
    ends = torch.tensor([list(start), list(home)], dtype=torch.float64)
    duration = _shortest(arm, ends[1] - ends[0], use)
    if constraints.torque:
        duration = max(duration, _bearable(constraints.body, _quintic(arm, ends, 1.0), use))
    return _quintic(arm, ends, duration)


def _bearable(body: RigidBody, unit: Course, use: float) -> float:
    """Duration [s] in which moving takes a share of the torque limits at most, and all torques stay in them.

    What moves the arm on the way of 1 s is divided by the square of the duration; what holds it stays.

    Raises:
        InfeasibleError: when holding the arm leaves nothing to move it, whatever the duration.
    """
    still, limit = torch.zeros_like(unit.position), body.arm.torque_limit
    held = body.torque(unit.position, still, still)
    _refuse_heavy(body.arm, held.abs() / limit)
    moving = body.torque(unit.position, unit.velocity, unit.acceleration) - held
    left = torch.minimum(use * limit, limit - held * moving.sign())
    return float((moving.abs() / left).max().sqrt()) * _ROUNDING


def _refuse_heavy(arm: Arm, share: Tensor) -> None:
    """Refuse a way along which holding the arm takes too large a share of a torque limit, (T, J)."""
    row, joint = divmod(int(share.argmax()), arm.joints)
    if share[row, joint] > _HOLDABLE:
        raise InfeasibleError(
            f"the straight way asks too much torque at any speed, whatever controllers.careful: "
            f"{arm.joint_names[joint]} needs {float(share[row, joint]):.1%} of its limit to hold the arm on "
            f"it; allow more by robot.effort=…, or {_CLOSER}"
        )


def _shortest(arm: Arm, change: Tensor, use: float) -> float:
    """Duration [s] in which no joint uses more than a share of its limits of motion."""
    limits = (arm.velocity_limit, arm.acceleration_limit, arm.jerk_limit)
    longest = _SHORTEST
    for order, (peak, limit) in enumerate(zip(_PEAKS, limits), start=1):
        if limit is not None:
            needed = (peak * change.abs() / (use * limit)) ** (1 / order)
            longest = max(longest, float(needed.max()))
    return longest


def _quintic(arm: Arm, ends: Tensor, duration: float) -> Course:
    rest, time = torch.zeros_like(ends), torch.tensor([0.0, duration], dtype=torch.float64)
    return Course(arm.joint_names, time, ends, rest, rest).sampled(_POINTS / duration)
