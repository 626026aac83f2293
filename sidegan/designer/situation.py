"""Where and how a designer's trajectory may move."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sidegan.errors import ConfigError, ShapeError
from sidegan.validity import Region


@dataclass(frozen=True)
class Situation:
    """Where and how an arm may move; what is left out is that of its workspace and its trajectories."""

    home: Sequence[float] | None = None  # joint positions at rest at both ends [rad or m], (J,)
    regions: Sequence[Region] = ()  # to keep out of, beside the workspace's own
    velocity: float = 1.0  # share of the velocity limits that may be used
    torque: float = 1.0  # share of the torque limits that may be used
    period: float | None = None  # [s]
    # distance that is proven to be kept from regions and between links [m], if more than the workspace's
    clearance: float = 0.0

    def __post_init__(self) -> None:
        for name in ("velocity", "torque"):
            if not 0 < getattr(self, name) <= 1:
                raise ConfigError(f"{name} is {getattr(self, name)}, expected a share above 0 and up to 1")
        if self.period is not None and not (math.isfinite(self.period) and self.period > 0):
            raise ConfigError(f"period is {self.period}, expected a positive number of seconds")
        if not (math.isfinite(self.clearance) and self.clearance >= 0):
            raise ConfigError(f"clearance is {self.clearance}, expected metres, zero or more")

    def home_of(self, joints: int, usual: Sequence[float]) -> np.ndarray:
        """The home, or the usual one, (J,).

        Raises:
            ShapeError: when it is not one finite number per joint.
        """
        home = np.array(usual if self.home is None else list(self.home), dtype=float)
        if home.shape != (joints,) or not np.isfinite(home).all():
            raise ShapeError(f"home {self.home} must be {joints} finite joint positions")
        return home
