"""Settings of the search for one proven trajectory."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from sidegan.base.typed import Count, Hertz, NonNegative, Share, Size
from sidegan.errors import ConfigError


@dataclass(frozen=True)
class DesignerSettings:
    """How trajectories are designed."""

    samples: Size  # time points per period at which information and torques are taken
    refine: Annotated[int, Field(ge=1, le=99)]  # odd: finer points, for limits and distances
    reserve: Share  # share of each limit that a search keeps free
    clearance: NonNegative  # [m] that a search keeps from everything
    patience: Count  # evaluations from one start before the next has its turn
    rate: Hertz  # at which torques are measured: what a trajectory is worth beside what is known

    def __post_init__(self) -> None:
        if self.refine % 2 == 0:
            raise ConfigError(f"designer.refine is {self.refine}, expected an odd number")
