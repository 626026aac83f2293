"""What each artifact is made from: the stamps that chain the stages."""

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from sidegan.gan.variants import Variant
from sidegan.identification import Noise, study
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline import config
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.stamp import Stamp
from sidegan.robot import Arm, load_robot, with_effort
from sidegan.validity import Box, Constraints, Plane, Region

LIBRARY, GENERATOR, HISTORY, REPORT = "library.parquet", "generator.pt", "history.json", "report.json"
RESULTS, FACTS, SUMS = "results.parquet", "facts.parquet", "sums.pt"
SEEDS, RANDOM, LONG = "seeds", "random", "long-"  # sets that no generator made
NEGATIVES_TRAINING = 0  # whose output the surrogates learn from
IDENTIFICATION = [
    f"identification.{name}" for name in ("identify", "measurements", "metrics", "rls", "study", "sums")
]
# Not the kernels: tests hold them to the plain code, and either may be used.
_PHYSICS = ("trajectory", "dynamics", "excitation", "validity")


@dataclass(frozen=True)
class Task:
    """The configured arm, workspace and trajectories, and the stamp of everything made for them."""

    cfg: Config
    store: Store

    @cached_property
    def arm(self) -> Arm:
        """The arm."""
        return with_effort(load_robot(self.cfg.robot.name), self.cfg.robot.effort)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The family of the short trajectories."""
        family = self.cfg.trajectory
        return Trajectory(self.arm.joints, family.harmonics, family.period, family.home)

    @cached_property
    def constraints(self) -> Constraints:
        """The arm in its workspace; the home position is checked."""
        constraints = Constraints(self.arm, regions(self.cfg.workspace), self.cfg.workspace.torque)
        constraints.refuse_home(self.trajectory.home or ())
        return constraints

    @property
    def body(self) -> RigidBody:
        """Dynamics of the arm."""
        return self.constraints.body

    def long_trajectory(self, harmonics: int) -> Trajectory:
        """The family of a single long trajectory."""
        return Trajectory(self.arm.joints, harmonics, self.cfg.long.period, self.trajectory.home)

    def random(self, purpose: str, training: int = 0) -> np.random.SeedSequence:
        """The random numbers of one purpose, independent of all others."""
        tail = [training] if training else []
        return np.random.SeedSequence([self.cfg.seed, *purpose.encode(), *tail])

    def number(self, purpose: str, training: int = 0) -> int:
        """One random seed for ``purpose``."""
        return int(self.random(purpose, training).generate_state(1)[0] & 0x7FFF_FFFF)

    def named(self, name: str, training: int) -> str:
        """Name of a variant or set for people; the training is told where there are several."""
        return f"{name}-{training}" if name in self.cfg.gan and len(self.cfg.trainings) > 1 else name

    def short_sets(self) -> list[tuple[str, int]]:
        """Name and training of every pool of short trajectories that a set is picked from."""
        generated = [(name, training) for name in self.cfg.gan for training in self.cfg.trainings]
        return [(RANDOM, 0), (SEEDS, 0), *generated]

    def sets(self) -> list[tuple[str, int]]:
        """Name and training of every excitation set that is compared."""
        return [*((f"{LONG}{h}", 0) for h in self.cfg.long.harmonics), *self.short_sets()]

    @property
    def seeds(self) -> Stamp:
        """Of the seed set."""
        wanted = self.cfg.seeds
        label = wanted.method if wanted.fitness == "eigenvalue" else f"{wanted.method}-{wanted.fitness}"
        return self.stamp("seeds", label, wanted, {}, ["seeds"])

    def kind(self, name: str) -> "Task":
        """The same task with another kind of seeds."""
        return replace_seeds(self, self.cfg.kinds[name])

    @property
    def random_set(self) -> Stamp:
        """Of the random valid trajectories."""
        values = {"count": self.cfg.library.count}
        return self.stamp("random", "random", values, {}, ["seeds.problem", "stages.random"])

    def surrogates(self, data: str) -> Stamp:
        """Of success predictor and converters that learn from ``broad`` samples or those of the ``paper``."""
        values = {**asdict(self.cfg.surrogates), "data": data}
        return self.stamp("surrogates", data, values, self._taught(), ["gan"])

    def gan(self, name: str, settings: Variant, training: int) -> Stamp:
        """Of a trained variant."""
        inputs = self._taught() if settings.seeded else {}
        if settings.surrogates:
            inputs["surrogates"] = self.surrogates(settings.data).digest
        values = {**asdict(settings), "evaluation": self.cfg.scale.evaluation}
        code = ["gan"] if settings.exact is None else ["gan", "seeds"]
        return self.stamp("gan", name, values, inputs, code, training)

    def library(self, name: str, training: int) -> Stamp:
        """Of a variant's library."""
        inputs = {"gan": self.gan(name, self.cfg.gan[name], training).digest}
        if self.cfg.gan[name].seeded:
            inputs[SEEDS] = self.seeds.digest  # for the diversity of both together
        code = ["library", "seeds"] if self.cfg.library.polish else ["library"]
        return self.stamp("library", name, self.cfg.library, inputs, code, training)

    def long(self, harmonics: int) -> Stamp:
        """Of a single long trajectory."""
        values = {**asdict(self.cfg.long), "harmonics": harmonics, "count": self.cfg.selection.count}
        label = f"{self.cfg.long.period:g}s-{harmonics}h"
        return self.stamp("long", label, values, {"seeds": self.seeds.digest}, ["seeds"])

    def selection(self, name: str, training: int) -> Stamp:
        """Of the pick from one pool: ``random``, ``seeds``, or the seeds and a variant's library."""
        inputs = {RANDOM: self.random_set.digest} if name == RANDOM else {SEEDS: self.seeds.digest}
        if name in self.cfg.gan:
            inputs["library"] = self.library(name, training).digest
        wanted = self.cfg.selection
        label = name if wanted.method == "greedy" else f"{name}-{wanted.method}"
        code = ["selection"] if wanted.method == "greedy" else ["criteria", "information", "optimal"]
        return self.stamp("selection", label, wanted, inputs, code, self._trained(name, training))

    def identification(self, name: str, training: int) -> Stamp:
        """Of the identification from one set."""
        if name.startswith(LONG):
            inputs = {"long": self.long(int(name.removeprefix(LONG))).digest}
        else:
            inputs = {"selection": self.selection(name, training).digest}
        trained = self._trained(name, training)
        return self.stamp("identification", name, self.cfg.identification, inputs, IDENTIFICATION, trained)

    def measured_sets(self) -> list[tuple[str, int]]:
        """Name and training of every whole set that is measured: the seeds and each library."""
        return [one for one in self.short_sets() if one[0] != RANDOM]

    def sums(self, name: str, training: int) -> Stamp:
        """Of the noisy measurements of a whole set."""
        inputs = {SEEDS: self.seeds.digest}
        if name in self.cfg.gan:
            inputs = {"library": self.library(name, training).digest}
        wanted = asdict(self.cfg.replication)
        wanted["replicas"] = max(wanted["replicas"]) if name == SEEDS else 1
        values = {**wanted, "rate": self.cfg.identification.rate}
        code = [*IDENTIFICATION, "identification.replication", "stages.replication"]
        return self.stamp("sums", name, values, inputs, code, self._trained(name, training))

    @property
    def replication(self) -> Stamp:
        """Of the identification from whole sets."""
        inputs = {f"{name} {k}": self.sums(name, k).digest for name, k in self.measured_sets()}
        values = {**asdict(self.cfg.replication), **asdict(self.cfg.identification)}
        code = [*IDENTIFICATION, "identification.replication", "stages.replication"]
        return self.stamp("replication", "-".join(self.cfg.gan), values, inputs, code)

    @property
    def sensitivity(self) -> Stamp:
        """Of the comparison repeated with other settings."""
        inputs = {"random": self.random_set.digest, SEEDS: self.seeds.digest}
        inputs |= {f"{n} {k}": self.library(n, k).digest for n, k in self.short_sets() if n in self.cfg.gan}
        inputs |= {f"kind {name}": self.kind(name).seeds.digest for name in self.cfg.kinds}
        values = {**asdict(self.cfg.identification), **asdict(self.cfg.sensitivity)}
        values["count"] = self.cfg.selection.count
        code = [*IDENTIFICATION, "selection", "stages.sensitivity"]
        return self.stamp("sensitivity", "-".join(self.cfg.gan), values, inputs, code)

    @property
    def density(self) -> Stamp:
        """Of the kernel density estimate of the seeds."""
        wanted = self.cfg.discussion
        values = {"bandwidths": wanted.bandwidths, "draws": wanted.draws}
        return self.stamp("density", "kde", values, self._taught(), ["stages.density"])

    def timing(self, name: str, training: int) -> Stamp:
        """Of a generator's measured speed."""
        inputs = {"gan": self.gan(name, self.cfg.gan[name], training).digest}
        return self.stamp("timing", name, {}, inputs, ["gan", "stages.timing"], training)

    def _trained(self, name: str, training: int) -> int | None:
        """The training that a set depends on, if it depends on one."""
        return None if name in (RANDOM, SEEDS) or name.startswith(LONG) else training

    def plant(self, name: str, training: int) -> Stamp:
        """Of the identification from one set that was executed on the plant."""
        if name.startswith(LONG):
            inputs = {"long": self.long(int(name.removeprefix(LONG))).digest}
        else:
            inputs = {"selection": self.selection(name, training).digest}
        values = {**asdict(self.cfg.plant), "tests": self.cfg.identification.tests}
        values["repeats"] = self.cfg.replication.repeats
        code = ["plant", "recording", "identification.estimate", "identification.model", "stages.plant"]
        return self.stamp("plant", name, values, inputs, code, self._trained(name, training))

    def _taught(self) -> dict[str, str]:
        """What surrogates and generators learn from."""
        known = {"seeds": self.seeds.digest}
        return known if self.cfg.subset is None else {**known, "subset": str(self.cfg.subset)}

    def stamp(
        self,
        stage: str,
        label: str,
        values: Any,
        inputs: dict[str, str],
        rooms: list[str],
        training: int | None = None,
    ) -> Stamp:
        """Of an artifact that depends on arm, workspace and trajectories, and on so much more.

        Args:
            stage: who makes it.
            label: what tells it from its siblings.
            values: settings that it depends on.
            inputs: digest of each thing that it is made from.
            rooms: whose code makes it.
            training: which one, where there are several.
        """
        values = values if isinstance(values, dict) else asdict(values)
        values = {stage: values} if training is None else {stage: values, "training": training}
        shared = {"workspace": asdict(self.cfg.workspace), "trajectory": self.trajectory.describe()}
        inputs = {"robot": self.arm.digest, **inputs}
        parts = [self.arm.name, label, f"seed{self.cfg.seed}"]
        parts += [] if training is None else [f"training{training}"]
        parts += [f"of{self.cfg.subset}"] if "subset" in inputs else []
        code = [*_PHYSICS, *rooms, "stages.common"]
        return self.store.stamp(stage, "-".join(parts), {**shared, **values}, inputs, code, self.cfg.seed)


def study_settings(
    settings: config.Identification, noise_model: config.NoiseModel | None = None
) -> study.Settings:
    """The comparison's settings as plain values; with another noise model when one is given."""
    noise = Noise(**asdict(noise_model or settings.noise))
    common = (settings.rate, settings.prior, settings.forgetting, settings.weighted)
    return study.Settings(*common, noise, settings.repeats)


def replace_seeds(task: Task, seeds: config.Seeds) -> Task:
    """The same task with other settings of the seeds."""
    return Task(replace(task.cfg, seeds=seeds, stages=[]), task.store)


def with_subset(task: Task, size: int) -> Task:
    """The same task, trained on so many of the seeds; on all of them it is the task itself."""
    if size >= task.cfg.seeds.count:
        return task
    side = {name: settings for name, settings in task.cfg.gan.items() if settings.features != "none"}
    trainings = task.cfg.scale.side_trainings
    return Task(replace(task.cfg, subset=size, gan=side or task.cfg.gan, trainings=trainings), task.store)


def regions(workspace: config.Workspace) -> list[Region]:
    """The keep-out regions of a configured workspace."""
    made: list[Region] = []
    for region in workspace.regions:
        if region.plane is not None:
            made.append(Plane(region.plane.normal, region.plane.offset))
        if region.box is not None:
            made.append(Box(region.box.lower, region.box.upper))
    return made
