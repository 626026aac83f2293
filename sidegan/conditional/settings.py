"""Settings of conditional generation, the schema of ``conf/conditional``."""

from dataclasses import dataclass
from typing import Annotated

from sidegan.base.typed import Bound, Count, Natural, NonNegative, Positive, Share
from sidegan.conditional.ranges import Ranges, Request
from sidegan.errors import ConfigError


@dataclass(frozen=True)
class TrainingSettings:
    """How the conditional generator is trained."""

    epochs: Count
    steps: Count  # per epoch
    batch: Annotated[int, Bound("≥", 2)]
    together: Annotated[int, Bound("≥", 2)]  # trajectories of a batch under one condition, kept diverse
    noise: Count
    width: Count
    learning_rate: Positive
    samples: Count  # time points per period
    reserve: Share  # of each torque limit, and four times that share of 0.25 m as clearance
    ease: Annotated[float, Bound(">", 0), Bound("≤", 1)]  # of the violations' weight, from which it grows
    violation: NonNegative  # weights of the losses
    emphasis: NonNegative  # log variance of the links that matter, beside the log condition number
    distance: NonNegative
    rank: NonNegative
    evaluation: Natural  # conditions whose trajectories are checked after an epoch

    def __post_init__(self) -> None:
        if self.batch % self.together:
            raise ConfigError(f"batch is {self.batch}, expected a multiple of together={self.together}")


@dataclass(frozen=True)
class StudySettings:
    """How well conditions are met, and what they cost."""

    conditions: Count  # of each kind
    count: Annotated[int, Bound("≥", 2)]  # trajectories under each
    compared: list[str]  # kinds of which some conditions have a generator of their own
    dedicated: Count  # such conditions of each of these kinds
    epochs: Count  # of such a generator
    pool: Count  # trajectories that sets are chosen from
    chosen: Count  # in a set

    def __post_init__(self) -> None:
        if self.chosen > self.pool or self.dedicated > self.conditions:
            raise ConfigError(
                f"chosen is {self.chosen} and dedicated {self.dedicated}, "
                f"expected at most pool={self.pool} and conditions={self.conditions}"
            )


@dataclass(frozen=True)
class ConditionalSettings:
    """The conditional generator, its study, and a library for one condition."""

    ranges: Ranges
    training: TrainingSettings
    study: StudySettings
    ask: Request | None  # null: measure how well everything is met
    count: Count  # valid trajectories for what is requested
    draws: Count  # most that are drawn for them
