"""The path from the arm's position to its trajectories' start, and back: straight, from rest to rest."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from sidegan.base.arrays import Array
from sidegan.controllers.course import POINTS, Course
from sidegan.controllers.settings import ExportSettings
from sidegan.errors import InfeasibleError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.validity import Constraints
from sidegan.validity.check import require_straight

# Largest velocity, acceleration and jerk of the quintic from 0 to 1 in unit time that rests at both ends.
_PEAKS = (15 / 8, 10 / 3**0.5, 60.0)
_POINTS = 40  # of a course
# Torques are computed at this many times at least, and once per step [rad or m] of the joints' summed
# travel; then in two rounds of finer steps near the largest.
_TIMES, _STEP = 400, 0.01
_ROUNDS, _NEAR, _FINER = 2, 0.99, 20
_HOLDABLE = 0.999  # largest share of a torque limit for holding the arm that leaves torque to move it
_ROUNDING = 1e-9
_SHORTEST = 0.5  # least duration [s]
_CLOSER = "move the arm closer to home by hand or with its own planner"


def approach(
    constraints: Constraints, start: Sequence[float], home: Sequence[float], settings: ExportSettings
) -> Course:
    """A course along the straight line in joint space between two configurations [rad or m].

    The joints move synchronously, on a quintic in time. At the planned speed the duration is the shortest,
    but at least half a second, in which no joint uses more than a share ``careful`` of its limits; for
    torque, this is the share for moving, on top of holding the arm. It is rounded up to whole samples. If the
    ends are the same, the arm rests there for half a second.

    Raises:
        ShapeError: when an end does not have one finite number per joint.
        InfeasibleError: when the straight line is not free, a joint cannot hold the arm on it, or it takes
            longer than ``longest``; says what to do.
    """
    arm = constraints.arm
    use = settings.careful
    try:
        require_straight(constraints, start, home)
    except InfeasibleError as error:
        raise InfeasibleError(f"{error}; {_CLOSER}, then update controllers.start") from error
    ends = np.array([start, home], float)
    needed = _for_motion(arm, ends[1] - ends[0], use)
    if constraints.torque:
        needed = np.maximum(needed, _for_torque(constraints.body, ends, use))
    planned = max(_SHORTEST, float(needed.max()) * (1 + _ROUNDING)) / settings.speed
    samples = max(POINTS, math.ceil(planned * settings.rate * (1 - _ROUNDING)))
    duration = samples / settings.rate
    if duration > settings.longest:
        raise InfeasibleError(
            f"the path from controllers.start to home takes {duration:.0f} s with {use:.0%} of the limits of "
            f"{arm.joint_names[int(needed.argmax())]}, at {settings.speed:.0%} of the speed; "
            f"controllers.longest={math.ceil(duration)} allows that, controllers.careful=… sets the share; "
            f"or {_CLOSER}"
        )
    return _quintic(arm, ends, duration, np.linspace(0, 1, _POINTS + 1))


def _for_motion(arm: Arm, change: Array, use: float) -> Array:
    """Duration [s], (J,), in which each joint uses a share of its limits on motion."""
    needed = np.zeros_like(change)
    limits = (arm.velocity_limit, arm.acceleration_limit, arm.jerk_limit)
    for order, (peak, limit) in enumerate(zip(_PEAKS, limits), start=1):
        if limit is not None:
            needed = np.maximum(needed, (peak * np.abs(change) / (use * limit)) ** (1 / order))
    return needed


def _for_torque(body: RigidBody, ends: Array, use: float) -> Array:
    """Duration [s], (J,), in which moving takes at most a share of each torque limit, within the limits.

    The torque for moving in 1 s is divided by the square of the duration; that for holding stays the same.

    Raises:
        InfeasibleError: when holding the arm leaves no torque to move it, for any duration.
    """
    arm = body.arm
    drives = body.arm.known_drives
    friction = drives.coulomb + use * drives.viscous * arm.velocity_limit  # at the highest allowed speed
    limit = np.maximum(arm.torque_limit - friction, np.finfo(float).tiny)

    def share(times: Array) -> Array:
        unit = _quintic(arm, ends, 1.0, times)
        still = np.zeros_like(unit.position)
        held = body.torque(unit.position, still, still)
        with np.errstate(over="ignore"):  # if friction uses a whole limit
            _refuse_heavy(arm, np.abs(held) / limit)
        moving = body.torque(unit.position, unit.velocity, unit.acceleration) - held
        moving = moving + drives.rotor_inertia * unit.acceleration
        return np.abs(moving) / np.minimum(use * limit, limit - held * np.sign(moving))

    count = max(_TIMES, math.ceil(float(np.abs(ends[1] - ends[0]).sum()) / _STEP))
    return np.sqrt(_largest(share, count))


def _largest(share: Callable[[Array], Array], count: int) -> Array:
    """Largest values, (J,), of a smooth function of time from 0 to 1, from ``count`` steps and refinement."""
    times = np.linspace(0, 1, count + 1)
    step = 1 / count
    found = share(times)
    largest = found.max(0)
    for _ in range(_ROUNDS):
        near = times[((found >= _NEAR * largest) & (largest > 0)).any(1)]
        if not len(near):  # zero throughout: the arm does not move
            break
        offsets = np.linspace(-step, step, 2 * _FINER + 1)
        times = np.unique(np.clip(near[:, None] + offsets, 0, 1))
        step /= _FINER
        found = share(times)
        largest = np.maximum(largest, found.max(0))
    return largest


def _refuse_heavy(arm: Arm, share: Array) -> None:
    """Refuse a path on which holding the arm takes too large a share of a torque limit, (T, J)."""
    row, joint = divmod(int(share.argmax()), arm.joints)
    if share[row, joint] > _HOLDABLE:
        raise InfeasibleError(
            f"the straight path needs too much torque at any speed and controllers.careful: "
            f"{arm.joint_names[joint]} needs {float(share[row, joint]):.1%} of its limit just to hold the "
            f"arm; allow more by robot.effort=…, or {_CLOSER}"
        )


def _quintic(arm: Arm, ends: Array, duration: float, share: Array) -> Course:
    """The course between ends (2, J) at shares of its duration [s], (T,)."""
    s = share[:, None]
    change = ends[1] - ends[0]
    done = s**3 * (10 + s * (6 * s - 15))
    return Course(
        arm.joint_names,
        duration * share,
        (1 - done) * ends[0] + done * ends[1],
        30 * (s * (1 - s)) ** 2 * change / duration,
        60 * s * (1 - s) * (1 - 2 * s) * change / duration**2,
    )
