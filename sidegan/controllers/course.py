"""What a controller is asked to follow: joint positions with their derivatives, over time."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Motion, Trajectory

# Points per period of the fastest harmonic. A controller that draws quintics between points with position,
# velocity and acceleration then stays within 3e-8 of the harmonic's amplitude: (2π/20)⁶ / 46080.
_POINTS = 20


@dataclass(frozen=True, eq=False)
class Course:
    """A motion of named joints, from rest to rest."""

    joint_names: tuple[str, ...]
    time: Tensor  # [s], (T,), from 0 on, rising
    position: Tensor  # [rad or m], (T, J)
    velocity: Tensor  # [rad/s or m/s], (T, J)
    acceleration: Tensor  # [rad/s² or m/s²], (T, J)

    def __post_init__(self) -> None:
        wanted = len(self.time), len(self.joint_names)
        for name in ("position", "velocity", "acceleration"):
            if getattr(self, name).shape != wanted:
                raise ShapeError(f"{name} is {tuple(getattr(self, name).shape)}, expected {wanted}")
        if len(self.time) < 2 or float(self.time[0]) != 0 or not (self.time.diff() > 0).all():
            raise ShapeError("time stamps must rise from 0 over two points or more")

    @classmethod
    def of(cls, joint_names: Sequence[str], motion: Motion) -> "Course":
        """The course of one motion, (1, T, J)."""
        if len(motion.position) != 1:
            raise ShapeError(f"a course is of one motion, got {len(motion.position)}")
        return cls(tuple(joint_names), motion.time, *(x[0] for x in motion[1:]))

    @property
    def duration(self) -> float:
        """From the first to the last point [s]."""
        return float(self.time[-1])

    def at(self, times: Tensor) -> Tensor:
        """Positions, (N, J), at times [s], (N,), on the quintics that join the points."""
        k = (torch.searchsorted(self.time, times, right=True) - 1).clamp(0, len(self.time) - 2)
        h = (self.time[k + 1] - self.time[k])[:, None]
        s = (times - self.time[k])[:, None] / h
        q, v, a = (getattr(self, name) for name in ("position", "velocity", "acceleration"))
        s3, s4, s5 = s**3, s**4, s**5
        rise = 10 * s3 - 15 * s4 + 6 * s5
        return (
            q[k] * (1 - rise)
            + q[k + 1] * rise
            + v[k] * h * (s - 6 * s3 + 8 * s4 - 3 * s5)
            + v[k + 1] * h * (-4 * s3 + 7 * s4 - 3 * s5)
            + a[k] * h**2 * (s**2 - 3 * s3 + 3 * s4 - s5) / 2
            + a[k + 1] * h**2 * (s3 - 2 * s4 + s5) / 2
        )

    def slowed(self, speed: float) -> "Course":
        """The same path at a share of the speed: velocities × speed, accelerations × speed².

        Raises:
            ShapeError: when the share is not above 0 and up to 1.
        """
        if not 0 < speed <= 1:
            raise ShapeError(f"speed is {speed}, expected a share above 0 and up to 1")
        return Course(
            self.joint_names,
            self.time / speed,
            self.position,
            speed * self.velocity,
            speed**2 * self.acceleration,
        )

    def then(self, other: "Course", pause: float = 0.0) -> "Course":
        """This course, a pause at rest [s], and another that starts where this one ends.

        Raises:
            ShapeError: when the other one is of other joints, or starts elsewhere.
        """
        apart = float((self.position[-1] - other.position[0]).abs().max())
        if other.joint_names != self.joint_names or apart > _MET:
            raise ShapeError(f"courses of one arm must meet: {apart:.3g} rad between their ends")
        start = self.time[-1] + pause
        begin = 0 if pause > 0 else 1  # the shared point of rest is kept once
        time = torch.cat([self.time, start + other.time[begin:]])
        parts = (
            torch.cat([getattr(self, name), getattr(other, name)[begin:]])
            for name in ("position", "velocity", "acceleration")
        )
        return Course(self.joint_names, time, *parts)


_MET = 1e-4  # [rad or m] between the end of one course and the start of the next


def knots(trajectory: Trajectory) -> Tensor:
    """Times [s] of the points between which quintics follow a trajectory of this family, (T,)."""
    return trajectory.times(_POINTS * trajectory.harmonics / trajectory.period)


def run_of(courses: Sequence[Course], pause: float) -> Course:
    """All courses one after another, with a pause at rest [s] between them.

    Raises:
        ShapeError: when there is none, or two do not meet.
    """
    if not courses:
        raise ShapeError("there are no courses to run")
    whole = courses[0]
    for one in courses[1:]:
        whole = whole.then(one, pause)
    return whole
