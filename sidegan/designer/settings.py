"""Settings of the designer, the schema of ``conf/designer``."""

from dataclasses import dataclass
from typing import Annotated

from sidegan.base.typed import Bound, Count, Hertz, NonNegative, Positive, Share, Size
from sidegan.errors import ConfigError


@dataclass(frozen=True)
class LibrarySettings:
    """The starts that are made once for an arm in its workspace."""

    count: Count  # situations with a trajectory each
    steps: Count  # evaluations for each
    # share of the way from home to the limits within which homes are drawn
    homes: Share
    rooms: Share  # share of the situations with regions of their own


@dataclass(frozen=True)
class DesignerSettings:
    """How trajectories are designed."""

    samples: Size  # time points per period at which information and torques are taken
    refine: Annotated[int, Bound("≥", 1), Bound("≤", 99)]  # odd: finer points, for limits and distances
    reserve: Share  # share of each limit that a search keeps free
    clearance: NonNegative  # [m] that a search keeps from everything
    neighbours: Count  # starts of the library that are compared
    patience: Count  # evaluations from one start before the next has its turn
    rate: Hertz  # at which torques are measured: what a trajectory is worth beside what is known
    library: LibrarySettings

    def __post_init__(self) -> None:
        if self.refine % 2 == 0:
            raise ConfigError(f"designer.refine is {self.refine}, expected an odd number")


@dataclass(frozen=True)
class GeneratorSettings:
    """A generator of starts, trained once for an arm in its workspace."""

    modes: Size  # trajectories for each situation
    width: Size
    depth: Count
    situations: Count  # that are drawn to learn from
    steps: Count
    batch: Size  # trajectories of a step
    learning_rate: Positive
    homes: Share  # of the way from home to the limits within which homes are drawn
    reserve: Share  # of each limit that is kept free
    clearance: NonNegative  # [m] that is kept from everything
