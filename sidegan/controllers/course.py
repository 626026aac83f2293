"""Motions for a controller to follow, and the straight path from the arm's position to home and back."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import reduce
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.base.settings_text import FILL_IN, suggestion
from sidegan.controllers.settings import ExportSettings
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints
from sidegan.validity.check import require_straight

# Points per period of the highest harmonic. Quintic interpolation of position, velocity and acceleration then
# deviates by 2e-8 of the harmonic's amplitude, (2π/20)⁶ / 46080, and linear interpolation by 1.2 %,
# (2π/20)² / 8.
POINTS = 20

_MET = 1e-4  # largest distance between the end of a course and the start of the next [rad or m]
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


class Course(NamedTuple):
    """A motion of named joints, from rest to rest."""

    joint_names: tuple[str, ...]
    time: Array  # [s], (T,), increasing from 0
    position: Array  # [rad or m], (T, J)
    velocity: Array  # [rad/s or m/s], (T, J)
    acceleration: Array  # [rad/s² or m/s²], (T, J)

    @classmethod
    def of(cls, joint_names: Sequence[str], motion: Motion) -> "Course":
        """The course of a motion (1, T, J)."""
        return cls(tuple(joint_names), motion.time, *(x[0] for x in motion[1:]))

    @property
    def duration(self) -> float:
        """Duration from the first to the last point [s]."""
        return float(self.time[-1])

    def for_controller(self, coupling: Array) -> "Course":
        """This motion in the controller's coordinates, from which ``coupling``, (J, J), makes the joints'."""
        inverse = np.linalg.inv(coupling)
        return Course(self.joint_names, self.time, *(x @ inverse.T for x in self[2:]))

    def sampled(self, rate: float) -> "Course":
        """This motion resampled at a rate [Hz], by quintic interpolation."""
        count = max(1, round(self.duration * rate))
        times = np.linspace(0, self.duration, count + 1)
        curve = scipy.interpolate.BPoly.from_derivatives(self.time, np.stack(self[2:], 1))
        return Course(self.joint_names, times, *(curve(times, k) for k in range(3)))


def least_rate(trajectory: Trajectory) -> float:
    """Least rate [Hz] of interpolation points for trajectories of this family."""
    return POINTS * trajectory.harmonics / trajectory.period


def slower(trajectory: Trajectory, c: Array, speed: float) -> tuple[Trajectory, Array]:
    """Family and coefficients [rad/s], (B, J, H, 2), of the same paths at a share of the speed."""
    return replace(trajectory, period=trajectory.period / speed), speed * c


def run_of(courses: Iterable[Course], pause: float, rate: float = 0.0) -> Course:
    """One or more courses in sequence, at rest for a pause [s] in between.

    Each starts where the last one ends; their common point occurs once. A pause has points at a
    ``rate`` [Hz], or only one at its end.

    Raises:
        ShapeError: when a course has different joints, or starts elsewhere.
    """
    waiting = np.linspace(0, pause, max(1, round(pause * rate)) + 1)[1:] if pause else np.empty(0)

    def join(one: Course, other: Course) -> Course:
        if other.joint_names != one.joint_names:
            raise ShapeError(f"courses of {one.joint_names} and {other.joint_names} cannot be joined")
        apart = float(np.abs(one.position[-1] - other.position[0]).max())
        if apart > _MET:
            raise ShapeError(f"consecutive courses must meet: their ends are {apart:.3g} rad or m apart")
        end = one.time[-1]
        still = np.zeros((len(waiting), len(other.joint_names)))
        return Course(
            one.joint_names,
            time=np.concatenate([one.time, end + waiting, end + pause + other.time[1:]]),
            position=np.concatenate([one.position, still + other.position[0], other.position[1:]]),
            velocity=np.concatenate([one.velocity, still, other.velocity[1:]]),
            acceleration=np.concatenate([one.acceleration, still, other.acceleration[1:]]),
        )

    return reduce(join, courses)


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
    arm, use = constraints.arm, settings.careful
    try:
        require_straight(constraints, start, home)
    except InfeasibleError as error:
        raise InfeasibleError(f"{error}; {_CLOSER}, then update controllers.start") from error
    ends = np.array([start, home], float)
    needed = np.zeros(arm.joints)  # durations [s], (J,)
    limits = (arm.velocity_limit, arm.acceleration_limit, arm.jerk_limit)
    for order, (peak, limit) in enumerate(zip(_PEAKS, limits), start=1):
        if limit is not None:
            fastest = (peak * np.abs(ends[1] - ends[0]) / (use * limit)) ** (1 / order)
            needed = np.maximum(needed, fastest)
    if constraints.torque:
        needed = np.maximum(needed, _for_torque(constraints.body, ends, use))
    planned = max(_SHORTEST, float(needed.max()) * (1 + _ROUNDING)) / settings.speed
    samples = max(POINTS, math.ceil(planned * settings.rate * (1 - _ROUNDING)))
    duration = samples / settings.rate
    if duration > settings.longest:
        slowest = arm.joint_names[int(needed.argmax())]
        raise InfeasibleError(
            f"the path from controllers.start to home takes {duration:.0f} s with {100 * use:.3g}% of the "
            f"limits of {slowest}, at {100 * settings.speed:.3g}% of the speed; "
            f"{suggestion('controllers.longest', math.ceil(duration))} allows that, "
            f"{suggestion('controllers.careful', FILL_IN)} sets the share; or {_CLOSER}"
        )
    return _quintic(arm, ends, duration, np.linspace(0, 1, _POINTS + 1))


def _for_torque(body: RigidBody, ends: Array, use: float) -> Array:
    """Duration [s], (J,), in which moving takes at most a share of each torque limit, within the limits.

    The torque for moving in 1 s is divided by the square of the duration; that for holding stays the same.

    Raises:
        InfeasibleError: when holding the arm and friction leave no torque to move it, for any duration.
    """
    arm = body.arm
    drives = body.arm.known_drives
    friction = drives.coulomb + use * drives.viscous * arm.velocity_limit  # at the highest allowed speed
    left = arm.torque_limit - friction

    def share(times: Array) -> Array:
        unit = _quintic(arm, ends, 1.0, times)
        still = np.zeros_like(unit.position)
        held = body.torque(unit.position, still, still)
        used = (np.abs(held) + friction) / arm.torque_limit
        row, joint = divmod(int(used.argmax()), arm.joints)
        if used[row, joint] > _HOLDABLE:
            name, careful = arm.joint_names[joint], suggestion("controllers.careful", FILL_IN)
            less = f"{careful} below {use:g} for less friction, " if drives.viscous[joint] else ""
            raise InfeasibleError(
                f"the straight path needs too much torque: holding the arm, and friction at {use:g} of the "
                f"velocity limit, take {float(used[row, joint]):.1%} of the limit of {name}; "
                f"allow more by {suggestion('robot.effort', FILL_IN)}, {less}or {_CLOSER}"
            )
        moving = body.torque(unit.position, unit.velocity, unit.acceleration) - held
        moving = moving + drives.rotor_inertia * unit.acceleration
        return np.abs(moving) / np.minimum(use * left, left - held * np.sign(moving))

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
