"""The typed schema of ``conf/``: what may be set, of which type, within which bounds.

Values live in the YAML files only; a field without a value there is refused. A new setting is a field
here and a line in its YAML file.
"""

import re
from dataclasses import dataclass
from typing import Annotated, Literal
from urllib.parse import urlsplit

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sidegan.base.typed import Bound, Count, Natural, NonNegative, Positive, Share, build
from sidegan.conditional.settings import ConditionalSettings
from sidegan.errors import ConfigError
from sidegan.gan.surrogates import SurrogateSettings
from sidegan.gan.variants import Variant
from sidegan.pipeline.config_beyond import Beyond
from sidegan.pipeline.config_identify import Identify, Model, Recording, check_files

Vector = tuple[float, float, float]

_STORES = {"http", "https", "sqlite", "postgresql", "mysql", "mssql", "databricks"}
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_SCHEDULER = re.compile(r"[a-z]+://[^\s/:]+:\d+")
_DEVICE = re.compile(r"cpu|mps|cuda(:\d+)?")


@dataclass(frozen=True)
class Kinds:
    """How many seeds of other kinds."""

    paper: Count
    diagonal: Count


@dataclass(frozen=True)
class Scale:
    """How large an experiment is; the other groups refer to these numbers."""

    name: str
    seeds: Count
    seed_steps: Count  # optimiser steps per seed
    labelled: Count  # samples that the surrogates learn from
    surrogate_epochs: Count
    gan_epochs: Count
    gan_steps: Count | None  # discriminator steps per epoch; null: as many as the seeds fill
    fitness_start: Natural  # first epoch in which the fitness loss counts
    exact_epochs: Count  # of variants with exact physics
    exact_steps: Count  # per epoch
    exact_seeded_steps: Count  # of those with discriminators
    evaluation: Count  # trajectories per epoch whose true physics is measured
    generated: Count  # valid generated trajectories in the library
    long_steps: Count  # optimiser steps of the single long trajectory
    repeats: Count  # noise realisations
    tests: Count  # test trajectories
    replications: Count  # noise realisations of whole sets
    kinds: Kinds
    counts: list[Count]  # selected trajectories, one comparison for each
    sizes: list[Count]  # of smaller seed sets
    draws: Count  # of a kernel density estimate
    trainings: list[Natural]  # of each variant
    side_trainings: list[Natural]  # of each variant on fewer seeds
    ablation_trainings: list[Natural]  # of each variant of the ablation
    brief_epochs: Count  # of exact variants that are compared with each other only
    transfer_epochs: Count  # of a training from scratch that transfer is compared with
    polished: Count  # trajectories of the polish curve


@dataclass(frozen=True)
class Robot:
    """Which arm: the name of a built-in one, or the path of a URDF."""

    name: str
    gains: list[float] | None  # of the drives, motor current to joint torque [N·m/A]
    effort: Annotated[float, Bound(">", 0), Bound("≤", 1)]  # share of velocity and torque limits to use


@dataclass(frozen=True)
class Plane:
    """Keep-out half space normal · x < offset [m]."""

    normal: Vector
    offset: float


@dataclass(frozen=True)
class Box:
    """Keep-out box between two corners [m]."""

    lower: Vector
    upper: Vector


@dataclass(frozen=True)
class Region:
    """One keep-out region."""

    plane: Plane | None = None
    box: Box | None = None

    def __post_init__(self) -> None:
        if (self.plane is None) == (self.box is None):
            raise ConfigError("a region is either a plane or a box")


@dataclass(frozen=True)
class Workspace:
    """Where the arm may move, and whether its torque limits count."""

    torque: bool
    regions: list[Region]


@dataclass(frozen=True)
class TrajectoryFamily:
    """The short cyclic trajectories."""

    harmonics: Count
    period: Positive  # [s]
    home: list[float] | None  # [rad or m]; null: the robot's zero position


@dataclass(frozen=True)
class Seeds:
    """The conventional optimiser that makes the seed set."""

    method: Literal["gradient", "paper"]
    fitness: Literal["eigenvalue", "diagonal"]
    count: Count
    samples: Count  # time points per period
    batch: Count  # trajectories per task
    steps: Count  # gradient: evaluations; paper: generations of the colony
    attempts: Count  # starts per seed before giving up
    reserve: Share | None = None  # gradient only: share of each limit that seeds keep free
    ants: Count | None = None  # paper only: size of the colony
    evaluations: Count | None = None  # paper only: of the compass search

    def __post_init__(self) -> None:
        if self.method == "paper" and None in (self.ants, self.evaluations):
            raise ConfigError("method paper needs ants and evaluations; choose it by seeds=paper")
        if self.method != "paper" and (self.ants, self.evaluations) != (None, None):
            raise ConfigError(f"ants and evaluations are of method paper; choose seeds={self.method}")
        if (self.method == "gradient") == (self.reserve is None):
            raise ConfigError("method gradient, and no other, needs reserve; choose it by seeds=gradient")


@dataclass(frozen=True)
class Expansion:
    """How the library grows from the generator."""

    count: Count
    batch: Count
    draws: Count  # most samples drawn before giving up
    polish: Natural  # gradient steps on every sample; 0: none
    reserve: Share  # of each limit, and twice that share of 0.25 m, that polished samples keep free


@dataclass(frozen=True)
class Selection:
    """How many trajectories are picked from a pool, and by what."""

    count: Count
    method: Literal["greedy", "d_optimal", "a_optimal", "d_exchange", "prediction"]
    noise: list[Positive] | None  # of each joint's torque [N·m], by which the joints count; not for greedy

    def __post_init__(self) -> None:
        if self.method == "greedy" and self.noise is not None:
            raise ConfigError("the paper's greedy score knows no noise: choose another method")


@dataclass(frozen=True)
class Long:
    """The single long trajectory that the short ones are compared with."""

    period: Positive  # [s]
    harmonics: list[Count]  # one trajectory for each
    samples: Count
    steps: Count  # evaluations, at least
    factor: Annotated[float, Bound("≥", 1)]  # CPU time, in that of all short ones of a selection together


@dataclass(frozen=True)
class NoiseModel:
    """Measurement noise."""

    kind: Literal["multiplicative", "additive"]
    level: NonNegative
    torque: bool
    state: bool


@dataclass(frozen=True)
class Identification:
    """Simulated measurements and recursive least squares."""

    rate: Positive  # [Hz]
    prior: Positive  # P₀ = prior · I
    forgetting: Annotated[float, Bound(">", 0), Bound("≤", 1)]
    weighted: bool  # also with one weight per joint, beside the paper's unweighted
    noise: NoiseModel
    repeats: Count
    tests: Count


@dataclass(frozen=True)
class Plant:
    """The arm in MuJoCo; a list holds a value per joint, or one for all."""

    rate: Positive  # [Hz]
    viscous: list[NonNegative]
    coulomb: list[NonNegative]
    rotor_inertia: list[NonNegative]
    bandwidth: list[Positive]  # [Hz]
    damping_ratio: list[Positive]
    feed_forward: Share
    tolerance: Positive
    encoder_resolution: list[NonNegative]
    torque_noise: list[NonNegative]
    torque_bias: list[float]


@dataclass(frozen=True)
class Replication:
    """Whole sets measured with noise on everything, the seeds several times over."""

    replicas: list[Count]  # how often the seeds are measured; one column of Table II for each
    noise: NoiseModel
    repeats: Count

    def __post_init__(self) -> None:
        if not self.replicas or len(set(self.replicas)) < len(self.replicas):
            raise ConfigError(f"replicas is {self.replicas}, expected one number or more, each once")


@dataclass(frozen=True)
class Sensitivity:
    """What the comparison of excitation sets is repeated with, one change at a time."""

    noises: dict[str, NoiseModel]
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
class Tracking:
    """Where MLflow records."""

    enabled: bool
    uri: str | None  # null: sqlite in the outputs

    def __post_init__(self) -> None:
        scheme = urlsplit(self.uri or "sqlite:").scheme.partition("+")[0]
        if scheme not in _STORES and self.uri != "databricks":
            raise ConfigError(
                f"uri is {self.uri!r}, expected null or a URI that starts with {', '.join(sorted(_STORES))}"
            )


@dataclass(frozen=True)
class Parallel:
    """How the work is spread over cores and machines."""

    workers: Count | None  # null: one per core; a Dask cluster elsewhere has as many as it has
    backend: Literal["loky", "dask"]
    scheduler: str | None  # address of a Dask scheduler; null: a cluster on this machine
    threads: Count | None  # of the main process; null: one per core

    def __post_init__(self) -> None:
        if self.scheduler is None:
            return
        if self.backend != "dask":
            raise ConfigError(f"scheduler is of dask; choose parallel=dask instead of {self.backend}")
        if not _SCHEDULER.fullmatch(self.scheduler):
            raise ConfigError(f"scheduler is {self.scheduler!r}, expected an address like tcp://host:8786")


@dataclass(frozen=True)
class Config:
    """Everything that can be set."""

    experiment: str
    stages: list[str]
    seed: Natural
    trainings: list[Natural]  # of each variant; seeds and surrogates are shared
    subset: Count | None  # train on so many of the seeds; null: on all
    outputs: str
    named: bool  # folders without a stamp in their name, as a pipeline tool wants them
    publish: str | None  # folder of the reproduction report; null: the run's own
    device: str
    scale: Scale
    robot: Robot
    workspace: Workspace
    trajectory: TrajectoryFamily
    seeds: Seeds
    surrogates: SurrogateSettings
    gan: dict[str, Variant]
    library: Expansion
    selection: Selection
    excite: list[str]  # pools that stage excite picks from: seeds, random, variants
    long: Long
    identification: Identification
    plant: Plant
    replication: Replication
    kinds: dict[str, Seeds]  # other seed sets that the seeds are compared with
    sensitivity: Sensitivity
    discussion: Discussion
    ablation: dict[str, Variant]  # variants that show what each part of the recipe does
    beyond: Beyond
    objectives: dict[str, Variant]  # exact variants with other objectives, trained briefly
    few_seeds: dict[str, Variant]  # exact variants for smaller seed sets, trained briefly
    conditional: ConditionalSettings
    recordings: list[str]  # files to identify from
    validation: list[str]  # files that are held out
    recording: Recording
    model: Model
    identify: Identify
    tracking: Tracking
    parallel: Parallel

    def __post_init__(self) -> None:
        for what, name in [
            ("experiment", self.experiment),
            *(("gan", name) for name in (*self.gan, *self.ablation)),
        ]:
            if not _NAME.fullmatch(name):
                raise ConfigError(f"{what}: {name!r} names a folder; use letters, digits, '_', '-' and '.'")
        if not _DEVICE.fullmatch(self.device):
            raise ConfigError(f"device is {self.device!r}, expected cpu, cuda, cuda:N or mps")
        if len(set(self.stages)) < len(self.stages):
            raise ConfigError(f"stages is {self.stages}, expected each stage once")
        if not self.trainings or len(set(self.trainings)) < len(self.trainings):
            raise ConfigError(f"trainings is {self.trainings}, expected one number or more, each once")
        if self.subset is not None and self.subset > self.seeds.count:
            raise ConfigError(f"subset is {self.subset}, expected at most seeds.count = {self.seeds.count}")
        if not self.excite or len(set(self.excite)) < len(self.excite):
            raise ConfigError(f"excite is {self.excite}, expected one pool or more, each once")
        if not self.gan:
            raise ConfigError("gan is empty, expected one variant or more")
        if self.replication.replicas and self.identification.forgetting < 1 and "replication" in self.stages:
            raise ConfigError(
                "replication adds sums that have no order in time: identification.forgetting must be 1"
            )
        check_files(self.recordings, self.validation)
        self._check_rates()
        self._check_counts()

    def _check_counts(self) -> None:
        """Refuse to choose more than there is."""
        sizes = [size for size in self.discussion.sizes if size > self.seeds.count]
        if sizes and "subsets" in self.stages:
            raise ConfigError(
                f"discussion.sizes has {sizes}, expected at most seeds.count = {self.seeds.count}"
            )
        if "sensitivity" in self.stages and max(self.sensitivity.counts) > min(
            self.seeds.count, self.library.count
        ):
            raise ConfigError(
                f"sensitivity.counts goes to {max(self.sensitivity.counts)}, expected at most seeds.count = "
                f"{self.seeds.count} and library.count = {self.library.count}"
            )
        library = self.seeds.count + self.library.count
        if self.selection.count > library:
            raise ConfigError(
                f"selection.count is {self.selection.count}, expected at most "
                f"seeds.count + library.count = {library}"
            )

    def _check_rates(self) -> None:
        """Refuse sampling that cannot see the highest harmonic."""
        if self.seeds.samples <= 2 * self.trajectory.harmonics:
            raise ConfigError(
                f"seeds.samples is {self.seeds.samples}, expected more than two per period of "
                f"the highest of trajectory.harmonics={self.trajectory.harmonics}"
            )
        if not self.long.harmonics or self.long.samples <= 2 * max(self.long.harmonics):
            raise ConfigError(
                f"long.samples is {self.long.samples}, expected more than two per period of "
                f"the highest of long.harmonics={self.long.harmonics}"
            )
        highest = max(
            self.trajectory.harmonics / self.trajectory.period, max(self.long.harmonics) / self.long.period
        )
        if self.identification.rate <= 2 * highest:
            raise ConfigError(
                f"identification.rate is {self.identification.rate:g} Hz, "
                f"expected more than twice the highest frequency, {highest:g} Hz"
            )


def validate(cfg: DictConfig) -> Config:
    """The configuration as typed plain values.

    Raises:
        ConfigError: unknown or missing keys, wrong types, values out of bounds, impossible combinations.
    """
    try:
        values = OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{error.full_key}: {str(error.msg).splitlines()[0]}") from error
    return build(Config, values)  # type: ignore[arg-type]
