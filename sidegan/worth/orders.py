"""What a set is made for, and what comes of it."""

import math
import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidegan.base.storage import read_json
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints
from sidegan.worth.settings import Contender, WorthSettings
from sidegan.worth.waypoints import Rests


class SetOf(NamedTuple):
    """A set of trajectories, (n, J, H, 2), of one family."""

    family: Trajectory | Rests
    coefficients: Tensor

    @classmethod
    def of(cls, family: Mapping[str, Any], coefficients: Tensor) -> "SetOf":
        """A set of what its family's ``describe`` has told."""
        return cls((Trajectory if "harmonics" in family else Rests)(**family), coefficients)


@dataclass(frozen=True)
class Order:
    """What a set is made for."""

    constraints: Constraints
    home: tuple[float, ...] | None
    settings: WorthSettings
    contender: Contender
    count: int
    seed: np.random.SeedSequence
    number: int = 0  # of the set among those of its contender

    def family(self, period: float | None = None) -> Trajectory:
        """The trajectories' family."""
        one = self.contender
        joints = self.constraints.arm.joints
        return Trajectory(joints, one.harmonics, period or one.period, self.home)

    def problem(self, period: float | None = None) -> Problem:
        """The optimisation of one of them."""
        return Problem(self.constraints, self.family(period), max(60, 3 * self.contender.harmonics))

    @property
    def generator(self) -> torch.Generator:
        """Random numbers of the set."""
        return torch.Generator().manual_seed(int(self.seed.generate_state(1, np.uint64)[0] >> 1))

    @property
    def file(self) -> Path:
        """The file that motions are taken from.

        Raises:
            ConfigError: when there is none for this arm.
        """
        name = self.constraints.arm.name
        found = file_of(self.contender, name)
        if found is None:
            raise ConfigError(f"{self.contender.title}: there is no file of motions for {name}")
        return found

    def option(self, name: str, default: float) -> float:
        """An option of the maker, one of ``settings.OPTIONS``."""
        return (self.contender.options or {}).get(name, default)


def file_of(one: Contender, arm: str) -> Path | None:
    """The file that a contender takes its motions for an arm from, if it is there."""
    path = Path((one.files or {}).get(arm, "")).expanduser()
    return path if path.is_file() else None


def seconds_of(path: Path) -> float:
    """CPU time [s] that a motion of a file took to be made; not a number where the file does not say so."""
    if path.suffix != ".json":
        return math.nan
    return statistics.fmean(float(one["seconds"]) for one in read_json(path)["trajectories"])
