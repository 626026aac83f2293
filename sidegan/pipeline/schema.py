"""Groups of settings that only the pipeline knows: arm, plants, comparisons, and workers."""

import re
from dataclasses import dataclass, field, fields
from typing import Annotated, Literal

from pydantic import Field

from sidegan.base.typed import Count, Natural, Number, Part, Positive
from sidegan.errors import ConfigError
from sidegan.identification import Terms
from sidegan.plant.recorded import Sensors
from sidegan.plant.varied import VariedSettings
from sidegan.robot import Setup

Workers = Annotated[int, Field(ge=1, le=4096)]
_SCHEDULER = re.compile(r"[a-z]+://[^\s/:]+:\d+")


@dataclass(frozen=True)
class ConditionSettings:
    """Condition of a comparison: a recipe in a workspace, on one seed set."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Plants:
    """Plants in the robot's place, and what is identified from them."""

    count: Count = 2
    plant: VariedSettings = VariedSettings()
    sensors: Sensors = Sensors()
    model: Terms = Terms()  # beside the rigid bodies


@dataclass(frozen=True, kw_only=True)
class Robot(Setup):
    """Which arm: a built-in one, or the path of a description, and what is to be said beside it."""

    name: str
    gains: list[Number] | None = None  # of the drives, motor current to joint torque [N·m/A]
    # share of velocity and torque limits to use; null: 0.8, or all of them where these hardly hold the arm
    effort: Part | None = None

    @property
    def setup(self) -> Setup:
        """Statements of the user beside the description."""
        return Setup(**{field.name: getattr(self, field.name) for field in fields(Setup)})


@dataclass(frozen=True, kw_only=True)
class Discussion:
    """Fewer seeds, and a kernel density estimate in place of the generator."""

    sizes: list[Count] = field(default_factory=lambda: [100, 200])  # of the seed set
    bandwidths: list[Positive] = field(
        default_factory=lambda: [1.0, 0.7, 0.5, 0.25, 0.1]
    )  # of the kernel, in units of Scott's rule
    draws: Count = 1000  # samples of the estimate whose validity is checked
    trainings: list[Natural] = field(default_factory=lambda: [0])  # of each variant on fewer seeds


@dataclass(frozen=True, kw_only=True)
class Parallel:
    """How the work is spread over cores and machines."""

    workers: Workers | None = None  # null: one per core; a Dask cluster elsewhere has as many as it has
    backend: Literal["loky", "dask"] = "loky"
    scheduler: str | None = None  # address of a Dask scheduler; null: a cluster on this machine

    def __post_init__(self) -> None:
        if self.scheduler is None:
            return
        if self.backend != "dask":
            raise ConfigError(f"scheduler is of dask; choose parallel=dask instead of {self.backend}")
        if not _SCHEDULER.fullmatch(self.scheduler):
            raise ConfigError(f"scheduler is {self.scheduler!r}, expected an address like tcp://host:8786")
