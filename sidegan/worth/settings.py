"""Settings of the study: plants, regimes, tasks and contenders."""

import math
from dataclasses import dataclass

from sidegan.base.typed import Count, Hertz, NonNegative, Positive, Seconds, Share, Size
from sidegan.design.prediction import Misfits
from sidegan.design.sequence import Search
from sidegan.designer import DesignerSettings
from sidegan.errors import ConfigError
from sidegan.identification import Terms
from sidegan.plant.friction import Form
from sidegan.plant.varied import VariedSettings

PIECE = 4.0  # [s] of motion whose sums are kept: periods and the horizon are whole numbers of these
OPTIONS = {"reach", "pool", "low", "high", "or"}  # that makers know


@dataclass(frozen=True)
class Legs:
    """Moves from rest to rest between random postures."""

    count: Size  # motions
    waypoints: Size  # postures that each visits
    distance: tuple[Share, Share]  # of the joints' ranges, from one to the next
    velocity: Share  # of the limit; of the acceleration limit its square
    rest: Seconds  # in each posture


@dataclass(frozen=True)
class Regime:
    """What makes identification hard."""

    form: Form  # of the plant's friction
    drift: bool  # whether friction and offsets change in the course of time


@dataclass(frozen=True)
class Sensors:
    """Noise and drift of torques, in shares of each joint's torque, and how signals are processed."""

    noise: NonNegative  # standard deviation
    correlation: Seconds  # time over which noise keeps its sign
    temperature: NonNegative  # standard deviation of friction's factor
    bias: NonNegative  # of the offset
    slow: Seconds  # time over which both change
    cutoff: Hertz  # of the filter without delay that positions and torques go through
    rate: Hertz  # of the samples that are identified from


@dataclass(frozen=True)
class StandIn:
    """Plants in a robot's place, and what is identified from them."""

    plants: Count
    plant: VariedSettings
    sensors: Sensors
    regime: Regime
    model: Terms  # beside the rigid bodies


@dataclass(frozen=True)
class Contender:
    """One way to make excitation sets."""

    maker: str  # a name in ``contenders.MAKERS``
    title: str
    period: Seconds
    harmonics: Count
    seconds: Seconds  # of motion of its own in a set; then the set is repeated
    ours: bool = False  # whether it is what this study wants to show
    practice: bool = False  # whether laboratories run it today: what the goal compares ours with
    bad: bool = False  # whether it is known to be bad: what tells whether the study can tell
    options: dict[str, float] | None = None  # of the maker
    files: dict[str, str] | None = None  # by arm, that a maker takes its motions from; none on other arms


@dataclass(frozen=True)
class WorthSettings:
    """The study."""

    others: dict[str, str]  # further arms: descriptions by name, studied in free space where they are there
    plants: Count
    compared: Count  # of them in the regimes too that are not judged, and identified by every estimator
    sets: Count  # of each contender
    distinct: Seconds  # of motion of its own in a set
    horizon: Seconds  # how long a robot moves at most
    within: Positive  # share of the floor by which an error may exceed it
    resolution: Positive  # relative error that a floor counts as at least
    acceleration: Positive  # limit where the arm has none: this many 1/s times its velocity limit
    resamples: Count  # of the bootstrap
    goal: Positive  # of the robot seconds of the best contender that is not ours, that ours need at most
    plant: VariedSettings
    sensors: Sensors
    regimes: dict[str, Regime]
    judged: list[str]  # regimes that the goal is about; the others tell whether the ranking stays
    model: Terms  # what is identified beside the rigid bodies
    believed: Positive  # how well the description is believed before, in typical sizes of its parameters
    tasks: dict[str, Legs]  # held out
    design_tasks: dict[str, Legs]  # that ``prediction`` designs for
    misfits: Misfits  # that it knows
    search: Search
    designer: DesignerSettings
    evaluations: Count  # of the designer for each trajectory of a set
    begun: Count  # the same for each point where a search for ``prediction`` begins
    contenders: dict[str, Contender]
    estimated: str  # whose sets estimators are compared on
    outliers: Share  # of the samples, where estimators are compared on outliers
    estimators: dict[str, dict[str, float] | None]  # settings of each method

    def __post_init__(self) -> None:
        if unknown := set(self.judged) - set(self.regimes):
            raise ConfigError(f"worth.judged has {sorted(unknown)}, expected some of {sorted(self.regimes)}")
        if not _whole(self.horizon, PIECE):
            raise ConfigError(f"worth.horizon is {self.horizon} s, expected a multiple of {PIECE:g} s")
        rate, seen = self.plant.rate, self.sensors.rate
        if not _whole(rate, seen):
            raise ConfigError(f"worth.plant.rate is {rate} Hz, expected a multiple of the sensors' {seen} Hz")
        if self.estimated not in self.contenders or self.contenders[self.estimated].files:
            raise ConfigError(f"worth.estimated is {self.estimated!r}, expected a contender without a file")
        for name, one in self.contenders.items():
            self._refuse(name, one)
        for side in ("ours", "practice"):
            if not any(getattr(one, side) and not one.bad for one in self.contenders.values()):
                raise ConfigError(f"worth.contenders: none is {side}, so there is nothing to compare")

    def _refuse(self, name: str, one: Contender) -> None:
        """Refuse a contender that cannot be judged."""
        if one.seconds < one.period:
            raise ConfigError(f"worth.contenders.{name}: {one.seconds} s hold no period of {one.period} s")
        options = one.options or {}
        for period in (one.period, options.get("or", one.period)):
            if not _whole(period, PIECE):
                raise ConfigError(
                    f"worth.contenders.{name}: a period is {period} s, expected a multiple of {PIECE:g} s"
                )
        if unknown := set(options) - OPTIONS:
            raise ConfigError(
                f"worth.contenders.{name}.options has {sorted(unknown)}, expected some of {sorted(OPTIONS)}"
            )

    def count(self, one: Contender) -> int:
        """Trajectories in a set of a contender."""
        return max(1, int(min(one.seconds, self.horizon) // one.period))


def _whole(size: float, part: float) -> bool:
    """Whether a size is a whole number of parts, one at least."""
    return math.isclose(size / part, max(1, round(size / part)), rel_tol=1e-9)
