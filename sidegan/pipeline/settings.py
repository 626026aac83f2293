"""The schema of ``conf/``: which settings a run has, which dataclass of which room each group of them is.

Values live in the YAML files only. A command composes the groups that it uses; the others are absent. What
only the pipeline knows (how large an experiment is, where it records, how it is spread) is described here.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sidegan.base.typed import Bound, Count, Natural, NonNegative, Positive, Share, build
from sidegan.conditional.settings import ConditionalSettings
from sidegan.design.selection import Selection
from sidegan.errors import ConfigError
from sidegan.gan import Variant
from sidegan.gan.surrogates import SurrogateSettings
from sidegan.identification import EstimationSettings, Noise, ReplicationSettings, StudySettings, Terms
from sidegan.library.draw import Expansion
from sidegan.plant import PlantSettings
from sidegan.recording.settings import RecordingSettings
from sidegan.seeds.settings import Long, Seeds
from sidegan.validity import Box, Plane

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
class Region:
    """One keep-out region."""

    plane: Plane | None = None
    box: Box | None = None

    def __post_init__(self) -> None:
        if (self.plane is None) == (self.box is None):
            raise ConfigError("a region is either a plane or a box")

    @property
    def shape(self) -> Plane | Box:
        """The plane or the box."""
        return self.plane or self.box  # type: ignore[return-value]


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
    objectives: dict[str, Variant]  # exact variants with other objectives, trained briefly
    few_seeds: dict[str, Variant]  # exact variants for smaller seed sets, trained briefly


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


class Absent:
    """A group of settings that the command does not compose; whoever asks for one of them is told so."""

    def __init__(self, group: str) -> None:
        self.group = group

    def _refuse(self, *arguments: Any) -> Any:
        raise ConfigError(
            f"there are no settings {self.group}: choose an experiment that has them, +experiment=…"
        )

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return self._refuse()

    __len__ = __iter__ = __getitem__ = __contains__ = _refuse


def _group(name: str) -> Any:
    return field(default=Absent(name))


@dataclass(frozen=True)
class Config:
    """The settings of a run: the first ones always, the others where its experiment composes them."""

    experiment: str
    stages: list[str]
    seed: Natural
    outputs: str
    named: bool  # folders without a digest in their name, as a pipeline tool wants them
    publish: str | None  # folder of a page and its tables; null: the run's own
    device: str
    tracking: Tracking
    parallel: Parallel
    robot: Robot = _group("robot")
    scale: Scale = _group("scale")
    workspace: Workspace = _group("workspace")
    trajectory: TrajectoryFamily = _group("trajectory")
    seeds: Seeds = _group("seeds")
    subset: Count | None = None  # train on so many of the seeds; null: on all
    surrogates: SurrogateSettings = _group("surrogates")
    gan: dict[str, Variant] = _group("gan")
    trainings: list[Natural] = field(
        default=Absent("trainings")
    )  # of each variant; seeds and surrogates are shared
    library: Expansion = _group("library")
    selection: Selection = _group("selection")
    excite: list[str] = field(
        default=Absent("excite")
    )  # pools that stage excite picks from: seeds, random, variants
    long: Long = _group("long")
    identification: StudySettings = _group("identification")
    plant: PlantSettings = _group("plant")
    replication: ReplicationSettings = _group("replication")
    kinds: dict[str, Seeds] = field(
        default=Absent("kinds")
    )  # other seed sets that the seeds are compared with
    sensitivity: Sensitivity = _group("sensitivity")
    discussion: Discussion = _group("discussion")
    ablation: dict[str, Variant] = field(
        default=Absent("ablation")
    )  # that show what each part of the recipe does
    beyond: Beyond = _group("beyond")
    conditional: ConditionalSettings = _group("conditional")
    recordings: list[str] = _group("recordings")  # files to identify from
    validation: list[str] = _group("validation")  # files that are held out
    recording: RecordingSettings = _group("recording")
    model: Terms = _group("model")
    identify: EstimationSettings = _group("identify")

    def has(self, *groups: str) -> bool:
        """Whether all of these settings are composed."""
        return not any(isinstance(getattr(self, name), Absent) for name in groups)

    def plain(self) -> dict[str, Any]:
        """All settings that are composed, as plain values."""
        names = [one.name for one in fields(self) if self.has(one.name)]
        return {name: asdict(self)[name] for name in names}

    def __post_init__(self) -> None:
        variants = [name for group in ("gan", "ablation") if self.has(group) for name in getattr(self, group)]
        for what, name in [("experiment", self.experiment), *(("gan", name) for name in variants)]:
            if not _NAME.fullmatch(name):
                raise ConfigError(f"{what}: {name!r} names a folder; use letters, digits, '_', '-' and '.'")
        if not _DEVICE.fullmatch(self.device):
            raise ConfigError(f"device is {self.device!r}, expected cpu, cuda, cuda:N or mps")
        _each_once("stages", self.stages, "stage", empty=True)
        if self.has("trainings"):
            _each_once("trainings", self.trainings, "number")
        if self.has("excite"):
            _each_once("excite", self.excite, "pool")
        if self.has("gan") and not self.gan:
            raise ConfigError("gan is empty, expected one variant or more")
        if self.has("recordings", "validation"):
            check_files(self.recordings, self.validation)
        if self.has("replication", "identification") and self.identification.forgetting < 1:
            raise ConfigError(
                "replication adds sums that have no order in time: identification.forgetting must be 1"
            )
        if self.has("seeds", "trajectory"):
            self._check_counts()
            self._check_rates()

    def _check_counts(self) -> None:
        """Refuse to choose more than there is."""
        seeds = self.seeds.count
        if self.subset is not None and self.subset > seeds:
            raise ConfigError(f"subset is {self.subset}, expected at most seeds.count = {seeds}")
        if self.has("discussion"):
            sizes = [size for size in self.discussion.sizes if size > seeds]
            if sizes and "subsets" in self.stages:
                raise ConfigError(f"discussion.sizes has {sizes}, expected at most seeds.count = {seeds}")
        if not self.has("library"):
            return
        if self.has("sensitivity") and "sensitivity" in self.stages:
            most = max(self.sensitivity.counts)
            if most > min(seeds, self.library.count):
                raise ConfigError(
                    f"sensitivity.counts goes to {most}, expected at most seeds.count = "
                    f"{seeds} and library.count = {self.library.count}"
                )
        if self.has("selection") and self.selection.count > seeds + self.library.count:
            raise ConfigError(
                f"selection.count is {self.selection.count}, expected at most "
                f"seeds.count + library.count = {seeds + self.library.count}"
            )

    def _check_rates(self) -> None:
        """Refuse sampling that cannot see the highest harmonic."""
        family = self.trajectory
        if self.seeds.samples <= 2 * family.harmonics:
            raise ConfigError(
                f"seeds.samples is {self.seeds.samples}, expected more than two per period of "
                f"the highest of trajectory.harmonics={family.harmonics}"
            )
        highest = family.harmonics / family.period
        if self.has("long"):
            if not self.long.harmonics or self.long.samples <= 2 * max(self.long.harmonics):
                raise ConfigError(
                    f"long.samples is {self.long.samples}, expected more than two per period of "
                    f"the highest of long.harmonics={self.long.harmonics}"
                )
            highest = max(highest, max(self.long.harmonics) / self.long.period)
        if self.has("identification") and self.identification.rate <= 2 * highest:
            raise ConfigError(
                f"identification.rate is {self.identification.rate:g} Hz, "
                f"expected more than twice the highest frequency, {highest:g} Hz"
            )


def _each_once(name: str, values: Sequence[object], what: str, empty: bool = False) -> None:
    if len(set(values)) < len(values) or not (values or empty):
        some = f"each {what} once" if empty else f"one {what} or more, each once"
        raise ConfigError(f"{name} is {values}, expected {some}")


def check_files(recordings: list[str], validation: list[str]) -> None:
    """Refuse a recording that is named twice, or that a model would be validated on after training.

    Raises:
        ConfigError: naming the file.
    """
    for name, files in (("recordings", recordings), ("validation", validation)):
        twice = [file for file in files if files.count(file) > 1]
        if twice:
            raise ConfigError(f"{name} has {twice[0]} twice")
    both = [file for file in validation if file in recordings]
    if both:
        raise ConfigError(f"validation has {both[0]}, which is in recordings: it would not be held out")


def validate(cfg: DictConfig) -> Config:
    """The configuration as typed plain values.

    Raises:
        ConfigError: unknown or missing keys, wrong types, values out of bounds, impossible combinations.
    """
    try:
        values: Any = OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{error.full_key}: {str(error.msg).splitlines()[0]}") from error
    if "ablation" in values:
        values["ablation"] = altered(values["ablation"], "ablation")
    for group in ("objectives", "few_seeds"):
        if group in values.get("beyond", {}):
            values["beyond"][group] = altered(values["beyond"][group], f"beyond.{group}")
    return build(Config, values)


def altered(group: Any, path: str) -> dict[str, Any]:
    """Variants that differ from others in some settings, by name.

    Args:
        group: ``variants`` by name, and ``changes`` by name, each ``{of: variant, …}`` with what differs.
        path: of the group, for messages.

    Raises:
        ConfigError: when a change is of a variant that is not there.
    """
    try:
        variants, changes = group["variants"], group["changes"]
        return {
            name: _merged(variants[one["of"]], {k: v for k, v in one.items() if k != "of"})
            for name, one in changes.items()
        }
    except (KeyError, TypeError) as error:
        raise ConfigError(
            f"{path} needs variants, and changes that are each of one of them: {error}"
        ) from error


def _merged(values: Any, changes: Any) -> Any:
    if not (isinstance(values, Mapping) and isinstance(changes, Mapping)):
        return changes
    return {**values, **{key: _merged(values.get(key), x) for key, x in changes.items()}}
