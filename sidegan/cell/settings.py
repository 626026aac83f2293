"""Settings of an arm in its cell, beside its description and its workspace."""

from dataclasses import dataclass

from sidegan.base.typed import NonNegative, Number, Part, Seconds, Size


@dataclass(frozen=True, kw_only=True)
class TrajectoryFamily:
    """The short cyclic trajectories."""

    harmonics: Size = 6
    period: Seconds = 16.0  # [s]
    home: list[Number] | None = None  # [rad or m]; null: as described, zeros, or a position that is found


@dataclass(frozen=True, kw_only=True)
class Choices(TrajectoryFamily):
    """What a user may choose of a cell, and what is decided otherwise."""

    # share of velocity and torque limits to use; null: 0.8, or all of them where these hardly hold the arm
    effort: Part | None = None
    clearance: NonNegative | None = None  # [m]; null: the workspace's
