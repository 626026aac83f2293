"""What is asked of a designer: a situation to move in, and an aim."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sidegan.errors import ConfigError, ShapeError
from sidegan.validity import Region

Kind = Literal["condition", "diagonal", "determinant", "variance"]


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


@dataclass(frozen=True, eq=False)
class Aim:
    """What a trajectory shall be good for.

    The condition number of YᵀY or the ratio of its diagonal is made small; or log det of the whole
    information, that of the prior and of the trajectory, large; or the variances of parameters of interest
    small.
    """

    kind: Kind = "condition"
    # information that there is already, in the orthonormal basis of ``information_of``, (p, p)
    prior: np.ndarray | None = None
    noise: Sequence[float] | None = None  # standard deviation of each joint's torque [N·m or N], (J,)
    interest: Mapping[str, float] | None = None  # weight of the variances of each link's base parameters

    def __post_init__(self) -> None:
        if self.kind not in ("condition", "diagonal", "determinant", "variance"):
            raise ConfigError(
                f"an aim is {self.kind!r}, expected condition, diagonal, determinant or variance"
            )
        if self.prior is not None and self.kind in ("condition", "diagonal"):
            raise ConfigError(
                f"a prior has no part in the aim {self.kind!r}: ask for determinant or variance"
            )
        if self.interest is not None and self.kind != "variance":
            raise ConfigError(f"links of interest have no part in the aim {self.kind!r}: ask for variance")

    def prior_of(self, size: int) -> np.ndarray:
        """The prior, or none, (p, p).

        Raises:
            ShapeError: when it is not symmetric and positive semidefinite.
        """
        if self.prior is None:
            return np.zeros((size, size))
        prior = np.array(self.prior, dtype=float)
        if prior.shape != (size, size) or not np.isfinite(prior).all():
            raise ShapeError(f"prior is {prior.shape}, expected finite numbers ({size}, {size})")
        slack = 1e-9 * float(np.abs(prior).max())
        if np.abs(prior - prior.T).max() > slack or np.linalg.eigvalsh(prior)[0] < -slack:
            raise ShapeError("prior is not symmetric and positive semidefinite")
        return (prior + prior.T) / 2

    def roots_of(self, joints: int) -> np.ndarray:
        """What the torque of each joint is multiplied by before it counts, (J,).

        Raises:
            ShapeError: when the noise is not one positive number per joint.
        """
        if self.noise is None:
            return np.ones(joints)
        noise = np.array(list(self.noise), dtype=float)
        if noise.shape != (joints,) or not (np.isfinite(noise) & (noise > 0)).all():
            raise ShapeError(f"noise {self.noise} must be {joints} positive numbers")
        return 1 / noise

    def interest_of(self, names: Sequence[str], links: np.ndarray) -> np.ndarray:
        """Weight of each base parameter, whose links are given by number, (p,).

        Raises:
            ConfigError: for a link that is none, or has no parameter of its own.
        """
        if self.interest is None:
            return np.ones(len(links))
        weights = np.zeros(len(links))
        for name, weight in self.interest.items():
            if name not in names:
                raise ConfigError(f"links has {name!r}, expected some of {', '.join(names)}")
            rows = links == list(names).index(name)
            if not rows.any():
                raise ConfigError(f"links has {name!r}, which has no parameters of its own to learn")
            if not (math.isfinite(weight) and weight >= 0):
                raise ConfigError(f"interest in {name!r} is {weight}, expected zero or more")
            weights[rows] = weight
        if not weights.any():
            raise ConfigError("interest gives no link any weight")
        return weights
