"""The way from where an arm stands to where its trajectories begin, and back: straight, from rest to rest."""

from collections.abc import Sequence

import torch
from torch import Tensor

from sidegan.controllers.course import Course
from sidegan.errors import InfeasibleError
from sidegan.robot import Arm
from sidegan.validity import Constraints
from sidegan.validity.straight import require_straight

# Largest velocity, acceleration and jerk of the quintic from 0 to 1 in unit time that rests at both ends.
_PEAKS = (15 / 8, 10 / 3**0.5, 60.0)
_POINTS = 40  # of the course, at which torques are looked at
_LONGER = 1.25  # times the duration, as long as a torque is too large
_TRIES = 20
_SHORTEST = 0.5  # [s]


def approach(constraints: Constraints, start: Sequence[float], home: Sequence[float], use: float) -> Course:
    """A course from one configuration [rad or m] to another on the straight way between them.

    The joints move in step, on a quintic in time; the duration is the shortest, half a second at least, in
    which no joint uses more than this share of its limits.

    Raises:
        ShapeError: when an end is not one finite number per joint.
        InfeasibleError: when the straight way is not free, and what to do; or a torque is too large.
    """
    arm = constraints.arm
    try:
        require_straight(constraints, start, home)
    except InfeasibleError as error:
        raise InfeasibleError(
            f"{error}; bring the arm closer to home by hand or by its own planner first, then say where it is"
        ) from error
    ends = torch.tensor([list(start), list(home)], dtype=torch.float64)
    duration = _shortest(arm, ends[1] - ends[0], use)
    for _ in range(_TRIES):
        course = _quintic(arm, ends, duration)
        states = course.position, course.velocity, course.acceleration
        torque = constraints.body.torque(*states).abs()
        if not constraints.torque or (torque <= torch.maximum(use * arm.torque_limit, _held(torque))).all():
            return course
        duration *= _LONGER
    worst = arm.named((torque > arm.torque_limit).any(0)) or "the arm"
    raise InfeasibleError(f"the straight way asks too much torque of {worst} at any speed")


def _held(torque: Tensor) -> Tensor:
    """What each joint needs to hold the arm at the ends of a course, (J,): no speed makes that less."""
    return torch.maximum(torque[0], torque[-1]) * (1 + 1e-9)


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
    s = torch.linspace(0, 1, _POINTS + 1, dtype=torch.float64)[:, None]
    change = ends[1] - ends[0]
    rise = 10 * s**3 - 15 * s**4 + 6 * s**5
    rate = (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
    growth = (60 * s - 180 * s**2 + 120 * s**3) / duration**2
    return Course(
        arm.joint_names, s[:, 0] * duration, ends[0] + rise * change, rate * change, growth * change
    )
