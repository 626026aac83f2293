"""Settings of conditional generation, the schema of ``conf/conditional``, and a request for one condition."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from sidegan.base.typed import Bound, Count, Natural, NonNegative, Positive, Seconds, Share, Size, Width
from sidegan.errors import ConfigError

Range = tuple[float, float]
Vector = tuple[float, float, float]

KINDS = ("home", "period", "effort", "plane", "walls", "obstacle", "links")
NONE, ALL = "none", "all"  # cases that request nothing, and everything


@dataclass(frozen=True)
class Obstacles:
    """Cubes that may have to be avoided."""

    lower: Vector  # [m], of their centres
    upper: Vector
    half: Range  # half edge [m]

    def __post_init__(self) -> None:
        _check("obstacle.half", self.half, 0.0)
        if any(low > high for low, high in zip(self.lower, self.upper)):
            raise ConfigError(f"obstacle.lower {list(self.lower)} lies above upper {list(self.upper)}")


@dataclass(frozen=True)
class Ranges:
    """What may be requested; a range that is null cannot. What is not requested is the most generous end."""

    home: NonNegative  # of each joint around the trajectory's home [rad or m]
    period: Range | None  # [s]
    velocity: Range  # share of the velocity limits
    torque: Range  # share of the torque limits
    plane: Range | None  # height to stay above [m]
    walls: Range | None  # half-widths of the room to stay in [m]
    obstacle: Obstacles | None
    links: bool  # whose parameters matter most
    clearance: NonNegative  # that a drawn home keeps from walls and obstacles [m]
    active: Annotated[float, Bound(">", 0), Bound("≤", 1)]  # share of drawn conditions that request a kind

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("period", self.period, 0.0, None),
            ("velocity", self.velocity, 0.0, 1.0),
            ("torque", self.torque, 0.0, 1.0),
            ("plane", self.plane, None, None),
            ("walls", self.walls, 0.0, None),
        ):
            if value is not None:
                _check(name, value, least, most)

    @property
    def kinds(self) -> tuple[str, ...]:
        """What may be requested at all."""
        trained = {
            "home": self.home > 0,
            "period": self.period is not None,
            "effort": self.velocity[0] < 1 or self.torque[0] < 1,
            "plane": self.plane is not None,
            "walls": self.walls is not None,
            "obstacle": self.obstacle is not None,
            "links": self.links,
        }
        return tuple(kind for kind in KINDS if trained[kind])

    @property
    def cases(self) -> dict[str, tuple[str, ...]]:
        """Kinds that each case of a study requests: none, each alone, all."""
        single = {kind: (kind,) for kind in self.kinds}
        return {NONE: (), **single, **({ALL: self.kinds} if len(single) > 1 else {})}


@dataclass(frozen=True)
class Cube:
    """A cube to keep out of."""

    centre: Vector  # [m]
    half: Positive  # half edge [m]


@dataclass(frozen=True)
class Request:
    """A request for one condition; what is left out is not requested."""

    home: list[float] | None = None  # [rad or m]
    period: Seconds | None = None
    effort: Share | None = None  # share of velocity and torque limits
    velocity: Share | None = None  # share of the velocity limits alone
    torque: Share | None = None
    plane: float | None = None  # height to stay above [m]
    walls: Range | None = None  # half-widths of the room in x and y [m]
    obstacle: Cube | None = None
    links: dict[str, NonNegative] | None = None  # how much each link's parameters matter

    def __post_init__(self) -> None:
        if self.effort is not None and (self.velocity, self.torque) != (None, None):
            raise ConfigError("effort is velocity and torque in one: give it or them")

    def columns(self) -> dict[str, float | Sequence[float]]:
        """Numbers of what is requested, by column of a condition; the links are left out."""
        cube = self.obstacle
        values = {
            "home": self.home,
            "period": self.period,
            "velocity": self.velocity if self.effort is None else self.effort,
            "torque": self.torque if self.effort is None else self.effort,
            "plane": self.plane,
            "walls": self.walls,
            "obstacle": None if cube is None else [*cube.centre, cube.half],
        }
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class TrainingSettings:
    """How the conditional generator is trained."""

    epochs: Count
    steps: Count  # per epoch
    batch: Annotated[int, Bound("≥", 2), Bound("≤", 1e5)]
    together: Annotated[int, Bound("≥", 2)]  # trajectories of a batch under one condition, kept diverse
    noise: Width
    width: Width
    learning_rate: Positive
    samples: Size  # time points per period
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


def _check(name: str, value: Range, least: float | None, most: float | None = None) -> None:
    low, high = value
    if not low <= high or (least is not None and low <= least) or (most is not None and high > most):
        bounds = [f"above {least:g}"] if least is not None else []
        bounds += [f"up to {most:g}"] if most is not None else []
        expected = " ".join(["expected a lower and a higher number", *bounds])
        raise ConfigError(f"{name} is {list(value)}, {expected}")
