"""Cost of violated constraints: squared relative violations."""

from dataclasses import dataclass

_DISTANCE = 0.25  # [m] clearance that counts like a whole limit


@dataclass(frozen=True)
class Penalty:
    """How strongly violations count, and the share of each limit that is kept in reserve."""

    weight: float
    limits: float = 0.05  # of position, velocity, acceleration and jerk
    torque: float = 0.05
    distance: float = 0.1

    @classmethod
    def reserving(cls, weight: float, reserve: float) -> "Penalty":
        """A share of each limit, and twice that share of 0.25 m, in reserve."""
        return cls(weight, limits=reserve, torque=reserve, distance=2 * reserve)

    @property
    def reach(self) -> float:
        """Smallest distance that costs nothing [m]."""
        return self.distance * _DISTANCE

    @property
    def close(self) -> float:
        """Weight of the square of what a distance lacks [1/m²]."""
        return self.weight / _DISTANCE**2
