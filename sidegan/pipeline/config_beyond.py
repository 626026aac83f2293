"""The part of the schema of ``conf/`` that is about the page on exact physics."""

from dataclasses import dataclass

from sidegan.base.typed import Count, NonNegative, Share


@dataclass(frozen=True)
class Target:
    """What a generator is transferred to; null: as it was."""

    robot: str | None  # an arm in stages/arms, a built-in one, or the path of a URDF
    home: list[float] | None  # [rad or m]
    payload: NonNegative  # [kg] at the tip
    desk: float | None  # [m] height of the only keep-out region


@dataclass(frozen=True)
class Beyond:
    """What is compared beside the variants."""

    source: str  # the variant that is polished and transferred
    repeats: Count  # noise realisations of each best set
    steps: list[Count]  # of polishing
    polished: Count  # trajectories of that curve
    finish: Count  # steps of polishing of a whole library, of as many trajectories as there are seeds
    sizes: list[Count]  # of few seeds
    epochs: Count  # of the training from scratch that transfer is compared with
    epoch: Count  # its steps per epoch
    share: Share  # of that schedule that a transferred generator gets
    reserve: Share  # of each limit that optimised trajectories keep free, beside the seeds with theirs
    targets: dict[str, Target]
