"""The optimisation problem of a trajectory, and coordinates in which all directions cost the same."""

from dataclasses import dataclass, replace

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.base.typed import Count, Share, Size
from sidegan.design.excitation import excitation_of
from sidegan.errors import ShapeError
from sidegan.kernels import HOPELESS
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER
from sidegan.validity import Constraints

_POINTS = 20  # per harmonic, for the means over time
_LEAST_ROOM = 0.1  # share of a joint's range that a start may use even if home is at its edge


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """Effort of the search for each trajectory of a set."""

    evaluations: Count = 400  # of the goal, per trajectory
    patience: Count = 130  # evaluations per start
    samples: Size = 40  # time points per period for information and torques
    reserve: Share = 0.03  # share of each limit to keep free; of distances, half this number [m]


@dataclass(frozen=True)
class Problem:
    """Condition number and constraints of an arm's trajectories.

    Raises:
        ShapeError: when the trajectories do not fit the arm, or the samples do not resolve all harmonics.
    """

    constraints: Constraints  # the arm and its workspace
    trajectory: Trajectory  # the family of trajectories
    samples: int = 60  # time points per period for the objective and the constraints
    strongest: int | None = None  # number of largest eigenvalues in the fitness; None: all
    box: float | None = None  # bound on absolute coefficients [rad/s]; None: no bound

    def __post_init__(self) -> None:
        joints, harmonics, _ = self.trajectory.shape
        if joints != self.body.joints:
            raise ShapeError(
                f"trajectories of {joints} joints do not fit {self.body.joints} joints of the arm"
            )
        if self.samples <= 2 * harmonics:
            raise ShapeError(
                f"samples is {self.samples}, expected more than {2 * harmonics}, twice the harmonics"
            )

    @property
    def body(self) -> RigidBody:
        """Dynamics of the arm."""
        return self.constraints.body

    @property
    def weakest(self) -> int:
        """Index, in ascending order, of the smallest eigenvalue in the fitness."""
        return 0 if self.strongest is None else max(0, len(self.body.base.columns) - self.strongest)

    def start(self, count: int, generator: np.random.Generator, reach: float = 0.7) -> Array:
        """Random coefficients [rad/s], (count, J, H, 2), each joint using ``reach`` of its tightest limit."""
        c = generator.standard_normal((count, *self.trajectory.shape))
        return c * (reach / self.limit_use(c))[:, :, None, None]

    def limit_use(self, c: Array) -> Array:
        """Largest share of its tightest limit that each joint uses, (B, J).

        The limits are those that are linear in the coefficients: position from home, velocity and, if
        present, acceleration, jerk, and the box.
        """
        arm = self.constraints.arm
        times = self.trajectory.grid(4 * self.samples)
        lower, upper = arm.position_lower, arm.position_upper
        home = np.array(self.trajectory.home)
        least = _LEAST_ROOM * (upper - lower)
        above, below = np.maximum(upper - home, least), np.maximum(home - lower, least)
        motion = self.trajectory.roll_out(c, times)
        away = motion.position - home
        position = np.maximum(away.max(1) / above, -away.min(1) / below)
        use = np.maximum(position, np.abs(motion.velocity).max(1) / arm.velocity_limit)
        for name, limit in self.constraints.higher.items():
            x = self.trajectory.derivative(c, times, DERIVATIVE_ORDER[name])
            use = np.maximum(use, np.abs(x).max(1) / limit)
        if self.box is not None:
            use = np.maximum(use, np.abs(c).max((2, 3)) / self.box)
        return np.maximum(use, 1e-9)

    def gram(self, c: Array) -> Array:
        """Gram matrices of the base regressor, (B, p, p)."""
        return gram(self.body, self.trajectory, c, self.samples)

    def fitness(self, c: Array) -> Array:
        """Condition number to minimise, (B,), at most ``HOPELESS``."""
        excitation = excitation_of(self.body, self.gram(c))
        strongest = replace(excitation, spectrum=excitation.spectrum[:, self.weakest :])
        return np.fmin(strongest.eigenvalue_fitness, HOPELESS)


@dataclass(frozen=True)
class Coordinates:
    """A linear map per joint from x, (B, J, 2 H), to coefficients [rad/s], (B, J, H, 2).

    The quintic that brings a joint to rest couples its coefficients: most changes of a single coefficient
    move the arm far, a few combinations hardly at all. At 560 s and 210 harmonics, random coefficients give
    almost only the quintic. In natural coordinates |x|² is the mean square of position and velocity, and of
    acceleration and jerk if limited, relative to their limits, plus that of the coefficients over the
    velocity limit, which bounds the combinations that hardly move the arm.
    """

    matrix: Array  # symmetric, (J, 2 H, 2 H); c = matrix @ x

    @classmethod
    def of(cls, problem: Problem) -> "Coordinates":
        """Natural coordinates of a problem's trajectories."""
        arm = problem.constraints.arm
        trajectory = problem.trajectory
        times = trajectory.grid(_POINTS * trajectory.harmonics)
        position = flatten(trajectory.basis(times, 0), 1)
        velocity = flatten(trajectory.basis(times, 1), 1)
        room = ((arm.position_upper - arm.position_lower) / 2)[:, None, None]
        speed = arm.velocity_limit[:, None, None]
        unit = np.eye(2 * trajectory.harmonics)
        metric = position.T @ position / len(times) / room**2
        metric = metric + (velocity.T @ velocity / len(times) + unit) / speed**2
        for name, limit in problem.constraints.higher.items():
            x = flatten(trajectory.basis(times, DERIVATIVE_ORDER[name]), 1)
            metric = metric + x.T @ x / len(times) / limit[:, None, None] ** 2
        values, vectors = np.linalg.eigh(metric)
        return cls(vectors @ (vectors / np.sqrt(values)[:, None]).mT)

    def coefficients(self, x: Array) -> Array:
        """Coefficients [rad/s], (B, J, H, 2), from points (B, J, 2 H)."""
        c = (x.swapaxes(0, 1) @ self.matrix.mT).swapaxes(0, 1)
        return c.reshape(*c.shape[:2], c.shape[2] // 2, 2)

    def points(self, c: Array) -> Array:
        """Points (B, J, 2 H) from coefficients [rad/s], (B, J, H, 2)."""
        return np.linalg.solve(self.matrix, flatten(c, 2).transpose(1, 2, 0)).transpose(2, 0, 1)

    def start(self, problem: Problem, count: int, generator: np.random.Generator, reach: float) -> Array:
        """Random points, (count, J, 2 H), each joint using ``reach`` of its tightest limit."""
        joints, size, _ = self.matrix.shape
        x = generator.standard_normal((count, joints, size))
        use = problem.limit_use(self.coefficients(x))
        return x * (reach / use)[:, :, None]
