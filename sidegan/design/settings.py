"""Settings of the search for trajectories."""

from dataclasses import dataclass

from sidegan.base.typed import Count, Share, Size


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """How much is spent on each trajectory of a set."""

    evaluations: Count = 400  # of the goal, for each trajectory
    patience: Count = 130  # of them from one start
    samples: Size = 40  # time points per period at which information and torques are taken
    reserve: Share = 0.03  # of each limit that a search keeps free, and half of it in metres as clearance
