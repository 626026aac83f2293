"""Motions for a controller to follow: joint positions with their derivatives over time."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Motion, Trajectory

# Points per period of the highest harmonic. Quintic interpolation of position, velocity and acceleration then
# deviates by 3e-8 of the harmonic's amplitude, (2π/20)⁶ / 46080, and linear interpolation by 1.3 %,
# (2π/20)² / 8.
POINTS = 20

STATES = ("position", "velocity", "acceleration")
_MET = 1e-4  # largest distance between the end of a course and the start of the next [rad or m]


@dataclass(frozen=True, eq=False)
class Course:
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

    def sampled(self, rate: float) -> "Course":
        """This motion resampled at a rate [Hz], by quintic interpolation."""
        count = max(1, round(self.duration * rate))
        times = np.linspace(0, self.duration, count + 1)
        states = np.stack([self.position, self.velocity, self.acceleration], 1)
        curve = scipy.interpolate.BPoly.from_derivatives(self.time, states)
        return Course(self.joint_names, times, *(curve(times, k) for k in range(3)))


def least_rate(trajectory: Trajectory) -> float:
    """Least rate [Hz] of interpolation points for trajectories of this family."""
    return POINTS * trajectory.harmonics / trajectory.period


def slower(trajectory: Trajectory, c: Array, speed: float) -> tuple[Trajectory, Array]:
    """Family and coefficients [rad/s], (B, J, H, 2), of the same paths at a share of the speed."""
    return replace(trajectory, period=trajectory.period / speed), speed * c


def run_of(courses: Iterable[Course], pause: float, rate: float = 0.0) -> Course:
    """All courses in sequence, at rest for a pause [s] in between, with points at a rate [Hz].

    Each starts where the last one ends; their common point occurs once.

    Raises:
        ShapeError: when a course has different joints, or starts elsewhere.
    """
    waiting = np.linspace(0, pause, max(1, round(pause * rate)) + 1)[1:] if pause else np.empty(0)

    def joined(one: Course, other: Course) -> Course:
        apart = float(np.abs(one.position[-1] - other.position[0]).max())
        if other.joint_names != one.joint_names or apart > _MET:
            raise ShapeError(f"consecutive courses must meet: their ends are {apart:.3g} rad or m apart")
        rest = np.zeros((len(waiting), len(other.joint_names)))
        begin = one.time[-1]
        return Course(
            one.joint_names,
            np.concatenate([one.time, begin + waiting, begin + pause + other.time[1:]]),
            np.concatenate([one.position, rest + other.position[0], other.position[1:]]),
            np.concatenate([one.velocity, rest, other.velocity[1:]]),
            np.concatenate([one.acceleration, rest, other.acceleration[1:]]),
        )

    return reduce(joined, courses)
