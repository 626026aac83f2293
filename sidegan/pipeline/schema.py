"""Groups of settings that only the pipeline knows: size, records, and workers."""

import re
from dataclasses import dataclass, fields
from typing import Annotated, Literal
from urllib.parse import urlsplit

from sidegan.base.typed import Bound, Count, Natural, NonNegative, Part, Positive, Seconds, Share, Size
from sidegan.errors import ConfigError
from sidegan.gan import Variant
from sidegan.gan.surrogates import SurrogateSettings
from sidegan.identification import Noise
from sidegan.library.draw import Expansion
from sidegan.pipeline.workspace import Region, Workspace
from sidegan.robot import Setup
from sidegan.seeds.settings import Long, Seeds

_STORES = {"http", "https", "sqlite", "postgresql", "mysql", "mssql", "databricks"}
Workers = Annotated[int, Bound("≥", 1), Bound("≤", 4096)]
_SCHEDULER = re.compile(r"[a-z]+://[^\s/:]+:\d+")


@dataclass(frozen=True)
class Kinds:
    """How many seeds of other kinds."""

    diagonal: Count


@dataclass(frozen=True)
class Scale:
    """How large an experiment is; the other groups refer to these numbers."""

    name: str
    seeds: Count
    seed_steps: Count  # optimiser steps per seed
    long_steps: Count  # of a single long trajectory
    labelled: Count  # samples that the surrogates learn from
    surrogate_epochs: Count
    shallow_epochs: Count  # of the paper's surrogates
    gan_epochs: Count
    gan_steps: Count | None  # discriminator steps per epoch; null: as many as the seeds fill
    fitness_start: Natural  # first epoch in which the fitness loss counts
    exact_epochs: Count  # of variants with exact physics
    exact_steps: Count  # per epoch
    exact_seeded_steps: Count  # of those with discriminators
    evaluation: Count  # trajectories per epoch whose true physics is measured
    generated: Count  # valid generated trajectories in the library
    repeats: Count  # noise realisations
    tests: Count  # test trajectories
    replications: Count  # noise realisations of whole sets
    plants: Count  # that stand in for the robot
    kinds: Kinds
    counts: list[Count]  # selected trajectories, one comparison for each
    sizes: list[Count]  # of smaller seed sets
    draws: Count  # of a kernel density estimate
    trainings: list[Natural]  # of each variant
    side_trainings: list[Natural]  # of each variant on fewer seeds
    ladder_trainings: list[Natural]  # of each rung of the ladder, and of each variant of the ablation
    brief_epochs: Count  # of exact variants that are compared with each other only
    transfer_epochs: Count  # of a training from scratch that transfer is compared with
    polished: Count  # trajectories of the polish curve


@dataclass(frozen=True, kw_only=True)
class Robot(Setup):
    """Which arm: a built-in one, or the path of a description, and what is to be said beside it."""

    name: str
    gains: list[float] | None  # of the drives, motor current to joint torque [N·m/A]
    # share of velocity and torque limits to use; null: 0.8, or all of them where these hardly hold the arm
    effort: Part | None

    @property
    def setup(self) -> Setup:
        """What is said beside the description."""
        return Setup(**{field.name: getattr(self, field.name) for field in fields(Setup)})


@dataclass(frozen=True)
class Asked:
    """One situation, and what its trajectory shall be good for; null is what holds everywhere."""

    name: str | None = None  # of the trajectory's file
    home: list[float] | None = None  # [rad or m]
    regions: list[Region] | None = None  # to keep out of, beside the workspace's own
    velocity: Share = 1.0  # share of the velocity limits that may be used
    torque: Share = 1.0  # share of the torque limits
    period: Seconds | None = None
    clearance: NonNegative = 0.0  # [m] that is proven to be kept, if more than the workspace's
    aim: Literal["condition", "diagonal", "determinant", "variance", "prediction"] = "condition"
    noise: list[Positive] | None = None  # of each joint's torque [N·m or N]
    links: dict[str, NonNegative] | None = None  # whose parameters count: determinant, variance


@dataclass(frozen=True)
class Several:
    """The situations of a file."""

    situations: list[Asked]


@dataclass(frozen=True)
class Designs:
    """What is asked of the designer, and what an answer may take."""

    ask: Asked
    file: str | None  # YAML file with a list of situations in place of the one
    starts: Literal["library", "generator"]  # what searches start from; each is made by a stage of its own
    evaluations: Count | None
    deadline: Seconds | None

    def __post_init__(self) -> None:
        if self.evaluations is None and self.deadline is None:
            raise ConfigError("design needs evaluations or a deadline")


@dataclass(frozen=True)
class Column:
    """Settings under which the paper's comparison is made once more; null: the run's own."""

    title: str
    group: str  # columns of a group differ in their seed set alone: their trainings count together
    trainings: list[Natural] | None = None
    seed: Natural | None = None
    half: Literal[0, 1] | None = None  # of the seed set, that everything is trained on
    workspace: Workspace | None = None
    seeds: Seeds | None = None
    kinds: dict[str, Seeds] | None = None
    long: Long | None = None
    surrogates: SurrogateSettings | None = None
    gan: dict[str, Variant] | None = None
    library: Expansion | None = None


@dataclass(frozen=True)
class TrajectoryFamily:
    """The short cyclic trajectories."""

    harmonics: Size
    period: Seconds  # [s]
    home: list[float] | None  # [rad or m]; null: the robot's zero position


@dataclass(frozen=True)
class Sensitivity:
    """What the comparison of excitation sets is repeated with, one change at a time."""

    noises: dict[str, Noise]
    priors: list[Positive]
    counts: list[Count]  # selected trajectories
    repeats: Count  # noise realisations of each


@dataclass(frozen=True)
class Discussion:
    """Fewer seeds, and a kernel density estimate in place of the generator."""

    sizes: list[Count]  # of the seed set
    bandwidths: list[Positive]  # of the kernel, in units of Scott's rule
    draws: Count  # samples of the estimate whose validity is checked


@dataclass(frozen=True)
class Elsewhere:
    """Test trajectories that are unlike those that models are identified from."""

    slow: Part  # size, of a random valid trajectory's
    fast: Annotated[float, Bound(">", 0), Bound("≤", 1)]  # share of the tightest joint limit that is used
    moves: Count  # from rest to rest in one recording of pick and place
    velocity: Annotated[float, Bound(">", 0), Bound("≤", 1)]  # share of the limits that they reach
    rest: Seconds  # between two of them [s]


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
    bandwidth: Positive  # of the density estimate of the seeds that generators are compared with, of Scott's
    targets: dict[str, Target]
    objectives: dict[str, Variant]  # exact variants with other objectives, trained briefly
    few_seeds: dict[str, Variant]  # exact variants for smaller seed sets, trained briefly


@dataclass(frozen=True)
class Tracking:
    """Where MLflow records."""

    enabled: bool
    uri: str | None  # null: sqlite in the outputs
    patience: NonNegative  # [s] that a run takes before MLflow is imported; a shorter one is sent at its end

    def __post_init__(self) -> None:
        scheme = urlsplit(self.uri or "sqlite:").scheme.partition("+")[0]
        if scheme not in _STORES and self.uri != "databricks":
            raise ConfigError(
                f"uri is {self.uri!r}, expected null or a URI that starts with {', '.join(sorted(_STORES))}"
            )


@dataclass(frozen=True)
class Parallel:
    """How the work is spread over cores and machines."""

    workers: Workers | None  # null: one per core; a Dask cluster elsewhere has as many as it has
    backend: Literal["loky", "dask"]
    scheduler: str | None  # address of a Dask scheduler; null: a cluster on this machine
    threads: Workers | None  # of the main process; null: one per core

    def __post_init__(self) -> None:
        if self.scheduler is None:
            return
        if self.backend != "dask":
            raise ConfigError(f"scheduler is of dask; choose parallel=dask instead of {self.backend}")
        if not _SCHEDULER.fullmatch(self.scheduler):
            raise ConfigError(f"scheduler is {self.scheduler!r}, expected an address like tcp://host:8786")
