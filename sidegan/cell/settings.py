"""What a user may choose of a cell beside its description and surroundings."""

from dataclasses import dataclass

from sidegan.base.typed import NonNegative, Number, PositiveShare, Seconds, Size


@dataclass(frozen=True, kw_only=True)
class TrajectoryFamily:
    """Settings of the short cyclic trajectories."""

    harmonics: Size = 6
    period: Seconds = 16.0  # [s]
    home: list[Number] | None = None  # [rad or m]; null: the description's, zeros, or a position found


@dataclass(frozen=True, kw_only=True)
class Choices(TrajectoryFamily):
    """What a user may choose of a cell, and the defaults."""

    # share of velocity and torque limits to use; null: 0.8, or 1 if that would hardly hold the arm
    effort: PositiveShare | None = None
    clearance: NonNegative | None = None  # [m]; null: the workspace's
