"""What a descent is given: where it looks at trajectories, and what violations cost."""

from dataclasses import dataclass
from typing import Protocol

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
