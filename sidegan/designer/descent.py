"""What a designer needs of those who calculate for it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sidegan.designer.aim import Aim
from sidegan.designer.scene import Scene

Array = np.ndarray

_DISTANCE = 0.15  # [m] clearance that counts like a whole limit


class Grid(Protocol):
    """Where trajectories are looked at."""

    @property
    def samples(self) -> int:
        """Time points per period at which information and torques are taken."""

    @property
    def refine(self) -> int:
        """Finer points for each of them, for limits and distances; odd."""

    @property
    def rate(self) -> float:
        """At which torques are measured [Hz]: what a trajectory is worth beside what is known."""


@dataclass(frozen=True)
class Penalties:
    """How strongly violations count, and what is kept in reserve."""

    weight: float
    reserve: float  # share of position and velocity limits
    torque: float  # share of torque limits
    reach: float  # smallest distance that costs nothing [m]

    @property
    def close(self) -> float:
        """Weight of the square of what a distance lacks [1/m²]."""
        return self.weight / _DISTANCE**2


class Descent(Protocol):
    """L-BFGS on one scene, at points (J, K) in natural coordinates."""

    @property
    def x(self) -> Array:
        """Where it is."""

    @property
    def goal(self) -> float:
        """The goal there."""

    @property
    def cost(self) -> float:
        """The penalty there."""

    @property
    def coefficients(self) -> Array:
        """Coefficients (J, K) [rad/s] there."""

    def place(self, x: Array) -> None:
        """Begin at a point."""

    def penalise(self, penalties: Penalties) -> None:
        """Go on with other penalties."""

    def run(self, evaluations: int) -> None:
        """So many evaluations."""

    def evaluate(self, x: Array, gradient: Array) -> tuple[float, float]:
        """Goal and penalty of a point; writes the gradient of their sum."""


class Descents(Protocol):
    """Descents for one arm in its workspace."""

    def descent(self, scene: Scene, aim: Aim, penalties: Penalties) -> Descent:
        """A descent in a scene, which is nowhere yet."""
