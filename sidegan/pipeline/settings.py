"""The schema of ``conf/``: the settings of a run, and the dataclass of each group.

Files in ``conf/`` begin with the defaults of these dataclasses, ``/defaults/<group>``. A command composes the
groups that it uses; the others are absent.
"""

import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from itertools import chain
from typing import Annotated, Any, get_type_hints

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import Field

from sidegan.base.conf import offer_defaults, options
from sidegan.base.extras import extra
from sidegan.base.typed import Count, Natural, Number, Positive, PositiveShare, ShareBelowOne, build
from sidegan.cell import TrajectoryFamily, Workspace
from sidegan.controllers import ExportSettings
from sidegan.design.problem import SearchSettings
from sidegan.design.selection import Selection
from sidegan.errors import ConfigError
from sidegan.gan.settings import DEFAULTS, Surrogates, TrainerSettings, Variant
from sidegan.identification import (
    EstimationSettings,
    GoalSettings,
    KnownLoad,
    ReplicationSettings,
    StudySettings,
    Terms,
)
from sidegan.library.draw import Expansion
from sidegan.plant import PlantSettings
from sidegan.plant.recorded import Sensors
from sidegan.plant.varied import VariedSettings
from sidegan.recording.settings import Recorded, RecordingSettings, paths_of
from sidegan.robot import Setup
from sidegan.seeding.settings import Long, Seeds

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_TRACKING = re.compile(
    r"(auto|local|off|databricks)$|(https?|sqlite|postgresql|mysql|mssql|databricks)(\+\w+)?:"
)
_SCHEDULER = re.compile(r"[a-z]+://[^\s/:]+:\d+")
Workers = Annotated[int, Field(ge=1, le=4096)]


@dataclass(frozen=True)
class ConditionSettings:
    """A condition to compare: a recipe in a workspace, with a seed set."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Plants:
    """Simulated plants that replace the robot, and the model identified from them."""

    count: Count
    plant: VariedSettings = VariedSettings()
    sensors: Sensors = Sensors()
    model: Terms = Terms()  # in addition to rigid bodies

    def __post_init__(self) -> None:
        rate, sensors = self.plant.rate, self.sensors
        of = f"of plant.rate={rate:g}"
        if sensors.cutoff >= rate / 2:
            raise ConfigError(f"sensors.cutoff is {sensors.cutoff:g}, expected less than half {of}")
        if rate < sensors.rate or rate % sensors.rate:
            raise ConfigError(f"sensors.rate is {sensors.rate:g}, expected a divisor {of}")


@dataclass(frozen=True, kw_only=True)
class Robot(Setup):
    """The arm: a built-in name or the path of a description, and settings that supplement it."""

    name: str
    gains: list[Number] | None = None  # of the drives, joint torque per motor current [N·m/A or N/A]
    # share of velocity and torque limits to use; null: 0.8, or 1 if the arm can hardly hold itself
    effort: PositiveShare | None = None

    @property
    def setup(self) -> Setup:
        """Settings that supplement the description."""
        return Setup(**{field.name: getattr(self, field.name) for field in fields(Setup)})


@dataclass(frozen=True, kw_only=True)
class Discussion:
    """Training on fewer seeds, a kernel density estimate instead of a generator, and generation speed."""

    sizes: list[Count]  # of the seed set
    # of the kernel, relative to Scott's rule
    bandwidths: list[Positive] = field(default_factory=lambda: [1.0, 0.7, 0.5, 0.25, 0.1])
    draws: Count  # samples of the density estimate to check
    trainings: list[Natural]  # of each variant on fewer seeds
    seconds: Positive  # duration of each speed measurement [s]


@dataclass(frozen=True, kw_only=True)
class Parallel:
    """How work is distributed over cores and machines."""

    workers: Workers | None  # processes on this machine; null: one per core
    scheduler: str | None  # address of a Dask cluster whose workers are used instead

    def __post_init__(self) -> None:
        if self.scheduler is not None and not _SCHEDULER.fullmatch(self.scheduler):
            raise ConfigError(f"scheduler is {self.scheduler!r}, expected an address like tcp://host:8786")


class Absent:
    """A group of settings that the command does not compose; using one of them raises a ConfigError."""

    def __init__(self, group: str) -> None:
        self.group = group

    def _refuse(self, *arguments: Any) -> Any:
        added = f"add +{self.group}=…, or " if options(self.group) else ""
        raise ConfigError(f"there are no settings {self.group}: {added}choose an experiment that has them")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return self._refuse()

    __len__ = __iter__ = __getitem__ = __contains__ = _refuse


def _group(name: str) -> Any:
    return field(default=Absent(name))


@dataclass(frozen=True)
class Config:
    """The settings of a run; groups that the experiment does not compose are ``Absent``."""

    experiment: str
    stages: list[str]
    seed: Natural
    outputs: str
    publish: str | None  # folder of a page and its tables, or the page's name; null: the run's folder
    trainer: TrainerSettings
    tracking: str  # auto, local, off, or the URI of an MLflow server or database
    parallel: Parallel
    usual: dict[str, float | None]  # what an experiment's clearance and effort are unless they are set
    robot: Robot = _group("robot")
    scale: dict[str, Any] = _group("scale")  # sizes of the experiment that other groups refer to
    workspace: Workspace = _group("workspace")
    trajectory: TrajectoryFamily = _group("trajectory")
    seeds: Seeds = _group("seeds")
    subset: Count | None = None  # number of seeds to train on; null: all
    surrogates: Surrogates = _group("surrogates")
    gan: dict[str, Variant] = _group("gan")
    trainings: list[Natural] = _group("trainings")  # of each variant; seeds and surrogates are shared
    evaluation: Count = _group("evaluation")  # trajectories per epoch to evaluate with exact physics
    library: Expansion = _group("library")
    selection: Selection = _group("selection")
    controllers: ExportSettings = _group("controllers")
    long: Long = _group("long")
    identification: StudySettings = _group("identification")
    plant: PlantSettings = _group("plant")
    plants: Plants = _group("plants")  # for the robot rows of Table I
    replication: ReplicationSettings = _group("replication")
    condition: ConditionSettings = _group("condition")
    conditions: list[str] | None = None  # that the page compares; null: only the run's own
    arms: list[str] = _group("arms")  # to compare, files of the group robot
    rows: dict[str, list[str]] = _group("rows")  # to compare: changes of the command's settings, by name
    discussion: Discussion = _group("discussion")
    table: str = _group("table")  # Python module that collects and presents the results
    recordings: list[Recorded] = _group("recordings")  # to identify from: one file each, or one per signal
    # recordings that are held out, or the share of every recording that is, at its end
    validation: list[Recorded] | ShareBelowOne = _group("validation")
    loaded: list[Recorded] = _group("loaded")  # recordings with a load
    load: KnownLoad = _group("load")
    known: str | None = _group("known")  # folder of the run that identified a model
    goal: GoalSettings = _group("goal")  # that excite designs for
    search: SearchSettings = _group("search")  # for excite's trajectories
    recording: RecordingSettings = _group("recording")
    model: Terms = _group("model")
    identify: EstimationSettings = _group("identify")

    def has(self, *groups: str) -> bool:
        """Whether the command composes all of these settings."""
        return not any(isinstance(getattr(self, name), Absent) for name in groups)

    @property
    def held_out(self) -> list[Recorded]:
        """Recordings to validate on; empty if the setting is absent or a share."""
        return self.validation if self.has("validation") and isinstance(self.validation, list) else []

    def plain(self) -> dict[str, Any]:
        """All composed settings, as plain values."""
        return {name: value for name, value in asdict(self).items() if self.has(name)}

    def __post_init__(self) -> None:
        checks = self._groups(), self._names(), self._files(), self._counts(), self._noise(), self._rates()
        if problem := next(chain(*checks), None):
            raise ConfigError(problem)

    def _groups(self) -> Iterator[str]:
        """Groups that are used together, and one of them is left out."""
        if self.has("workspace") != self.has("trajectory"):
            yield "workspace and trajectory are used together: choose an experiment that has both, or neither"

    def _names(self) -> Iterator[str]:
        """Invalid names, and lists that are empty or name something twice."""
        variants = list(self.gan) if self.has("gan") else None
        for what, name in [("experiment", self.experiment), *(("gan", name) for name in variants or ())]:
            if not _NAME.fullmatch(name):
                yield f"{what}: {name!r} names a folder; use letters, digits, '_', '-' and '.'"
        if variants == []:
            yield "gan is empty, expected one variant or more"
        if self.trainer != TrainerSettings():
            with extra("paper"):
                from sidegan.gan.training import unavailable

            if refused := unavailable(self.trainer):
                yield f"trainer is {asdict(self.trainer)}: {refused}"
        if not _TRACKING.match(self.tracking):
            yield f"tracking is {self.tracking!r}, expected auto, local, off, or a URI like http://host:5000"
        if len(set(self.stages)) < len(self.stages):
            yield f"stages is {self.stages}, expected each once"
        lists = {name: getattr(self, name) for name in ("trainings", "arms") if self.has(name)}
        if self.has("long"):
            lists["long.harmonics"] = self.long.harmonics
        if self.has("discussion"):
            lists["discussion.bandwidths"] = self.discussion.bandwidths
            lists["discussion.trainings"] = self.discussion.trainings
        for name, values in lists.items():
            if not values or len(set(values)) < len(values):
                yield f"{name} is {values}, expected one or more, each once"

    def _files(self) -> Iterator[str]:
        """Files that are named twice, or used for both training and validation."""
        if not self.has("recordings", "validation"):
            return
        training = [file for recording in self.recordings for file in paths_of(recording)]
        held_out = [file for recording in self.held_out for file in paths_of(recording)]
        for name, files in (("recordings", training), ("validation", held_out)):
            yield from (f"{name} has {file} twice" for file in files if files.count(file) > 1)
        for file in held_out:
            if file in training:
                yield f"validation has {file}, which is in recordings: it would not be held out"

    def _counts(self) -> Iterator[str]:
        """Counts that exceed the available seeds or trajectories, or are too small."""
        if not self.has("seeds"):
            return
        seeds = self.seeds.count
        if self.subset is not None and self.subset > seeds:
            yield f"subset is {self.subset}, expected at most seeds.count = {seeds}"
        sizes = self.discussion.sizes if self.has("discussion") and "subsets" in self.stages else []
        if any(size > seeds for size in sizes):
            yield f"discussion.sizes has {max(sizes)}, expected at most seeds.count = {seeds}"
        if {"surrogates", "gan", "subsets", "variations"} & {*self.stages}:  # they train
            counts = {"seeds.count": seeds, "subset": self.subset, "evaluation": self.evaluation}
            counts["discussion.sizes"] = min(sizes, default=None)
            for name, count in counts.items():
                if count == 1:
                    yield f"{name} is 1, expected two or more for training"
        if self.has("library", "selection") and "selection" in self.stages:
            # sets are picked from the seeds, from as many random trajectories as in a library, and from both
            for name, count in (("seeds", seeds), ("library", self.library.count)):
                if self.selection.count > count:
                    most = f"{name}.count = {count}"
                    yield f"selection.count is {self.selection.count}, expected at most {most}"

    def _noise(self) -> Iterator[str]:
        """Generators to be compared by errors that noise causes, without such noise."""
        noise = self.identification.noise if self.has("identification", "gan") else None
        if noise and not (noise.level and noise.torque):
            yield "identification.noise has none on torques, by whose errors sets are compared"

    def _rates(self) -> Iterator[str]:
        """Sampling rates below twice the highest harmonic."""
        if not self.has("seeds", "trajectory"):
            return
        family = self.trajectory
        few = "expected more than two per period of the highest harmonic,"
        if self.seeds.samples <= 2 * family.harmonics:
            yield f"seeds.samples is {self.seeds.samples}, {few} trajectory.harmonics={family.harmonics}"
        highest = family.harmonics / family.period
        if self.has("long"):
            most = max(self.long.harmonics)
            if self.long.samples <= 2 * most:
                yield f"long.samples is {self.long.samples}, {few} long.harmonics={self.long.harmonics}"
            highest = max(highest, most / self.long.period)
        if self.has("identification") and self.identification.rate <= 2 * highest:
            rate = f"identification.rate is {self.identification.rate:g} Hz"
            yield f"{rate}, expected more than twice the highest frequency, {highest:g} Hz"


def offer() -> None:
    """Offer the defaults of all groups to Hydra, before it composes."""
    hints = get_type_hints(Config).items()
    offer_defaults({name: x for name, x in hints if isinstance(x, type) and is_dataclass(x)} | DEFAULTS)


def validate(cfg: DictConfig) -> Config:
    """The configuration as typed values; a ConfigError names any setting that is wrong."""
    try:
        values: Any = OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        raise ConfigError(dangling(error)) from error
    for variants in (values.get("gan"), (values.get("surrogates") or {}).get("negatives")):
        if isinstance(variants, dict):
            variants.pop("generator", None)  # which each variant has resolved
    robot = values.get("robot")
    if isinstance(robot, dict) and isinstance(robot.get("limits"), str):  # robot.limits=joint_limits.yaml
        robot["limits"] = {"file": robot["limits"]}
    return build(Config, values)


def dangling(error: OmegaConfBaseException) -> str:
    """One-line message for a setting that refers to a missing one."""
    reason = str(error.msg or error).splitlines()[0]
    return f"{error.full_key}: {reason}" if error.full_key else reason
