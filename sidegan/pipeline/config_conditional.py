"""The part of the schema of ``conf/`` that is about the generator whose trajectories depend on conditions."""

from dataclasses import dataclass
from typing import Annotated

from sidegan.base.typed import Bound, Count, Natural, NonNegative, Positive, Share
from sidegan.errors import ConfigError

Span = tuple[float, float]
Place = tuple[float, float, float]


@dataclass(frozen=True)
class Obstacles:
    """Cubes that may have to be avoided."""

    lower: Place  # [m], of their centres
    upper: Place
    half: Span  # half edge [m]


@dataclass(frozen=True)
class Ranges:
    """What may be asked for; a range that is null cannot."""

    home: NonNegative  # of each joint around the trajectory's home [rad or m]
    period: Span | None  # [s]
    velocity: Span  # share of the velocity limits
    torque: Span  # share of the torque limits
    plane: Span | None  # height to stay above [m]
    walls: Span | None  # half-widths of the room to stay in [m]
    obstacle: Obstacles | None
    links: bool  # whose parameters matter most
    clearance: NonNegative  # that a home keeps from everything in training [m]
    active: Annotated[float, Bound(">", 0), Bound("≤", 1)]  # share of trajectories that a kind is asked of


@dataclass(frozen=True)
class Training:
    """How the generator is trained."""

    epochs: Count
    steps: Count  # per epoch
    batch: Annotated[int, Bound("≥", 2)]
    together: Annotated[int, Bound("≥", 2)]  # trajectories of a batch under one condition
    noise: Count
    width: Count
    learning_rate: Positive
    samples: Count  # time points per period
    reserve: Share  # of each torque limit, and four times that share of 0.25 m as clearance
    ease: Annotated[float, Bound(">", 0), Bound("≤", 1)]  # of the violations' weight, from which it grows
    violation: NonNegative  # weights of the losses
    emphasis: NonNegative
    distance: NonNegative
    rank: NonNegative
    evaluation: Natural  # conditions whose trajectories are checked after an epoch

    def __post_init__(self) -> None:
        if self.batch % self.together:
            raise ConfigError(f"batch is {self.batch}, expected a multiple of together={self.together}")


@dataclass(frozen=True)
class Study:
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
class Cube:
    """A cube to keep out of."""

    centre: Place  # [m]
    half: Positive  # half edge [m]


@dataclass(frozen=True)
class Ask:
    """One condition; what is left out is not asked for."""

    home: list[float] | None = None  # [rad or m]
    period: Positive | None = None  # [s]
    effort: Share | None = None  # share of velocity and torque limits
    velocity: Share | None = None  # share of the velocity limits alone
    torque: Share | None = None
    plane: float | None = None  # height to stay above [m]
    walls: Span | None = None  # half-widths of the room in x and y [m]
    obstacle: Cube | None = None
    links: dict[str, NonNegative] | None = None  # how much each link's parameters matter

    def __post_init__(self) -> None:
        if self.effort is not None and (self.velocity, self.torque) != (None, None):
            raise ConfigError("effort is velocity and torque in one: give it or them")


@dataclass(frozen=True)
class Conditional:
    """The conditioned generator."""

    ranges: Ranges
    training: Training
    study: Study
    ask: Ask | None  # null: measure how well everything is met
    count: Count  # valid trajectories for what is asked
    draws: Count  # most that are drawn for them
