"""Settings of the search for trajectories."""

from dataclasses import dataclass

from sidegan.base.typed import Count, Share, Size


@dataclass(frozen=True)
class SearchSettings:
    """How much is spent on each trajectory of a set."""

    evaluations: Count  # of the goal, for each trajectory
    patience: Count  # of them from one start
    samples: Size  # time points per period at which information and torques are taken
    reserve: Share  # of each limit that a search keeps free, and half of it in metres as clearance
