"""What each artifact is made from: the stamps that chain the stages."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from sidegan import config
from sidegan.artifacts import Store
from sidegan.config import Config
from sidegan.dynamics import RigidBody
from sidegan.errors import ConfigError
from sidegan.gan.variants import Variant, Weights
from sidegan.robot import Arm, load_robot
from sidegan.stamp import Stamp
from sidegan.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Plane, Region

_PHYSICS = ("trajectory", "dynamics", "excitation", "validity")


@dataclass(frozen=True)
class Task:
    """The configured arm, workspace and trajectories, and the stamp of everything made for them."""

    cfg: Config
    store: Store

    @cached_property
    def arm(self) -> Arm:
        """The arm."""
        return load_robot(self.cfg.robot.name)

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

    def random(self, purpose: str) -> np.random.SeedSequence:
        """The random numbers of one purpose, independent of all others."""
        return np.random.SeedSequence([self.cfg.seed, *purpose.encode()])

    def number(self, purpose: str) -> int:
        """One random seed for ``purpose``."""
        return int(self.random(purpose).generate_state(1)[0] & 0x7FFF_FFFF)

    @property
    def seeds(self) -> Stamp:
        """Of the seed set."""
        return self._stamp("seeds", self.cfg.seeds.method, self.cfg.seeds, {}, "seeds")

    @property
    def surrogates(self) -> Stamp:
        """Of success predictor and converters."""
        inputs = {"seeds": self.seeds.digest}
        return self._stamp("surrogates", "rollout", self.cfg.surrogates, inputs, "gan")

    def gan(self, name: str, settings: config.GanVariant) -> Stamp:
        """Of a trained variant."""
        inputs = {"seeds": self.seeds.digest}
        if variant(name, settings).surrogates:
            inputs["surrogates"] = self.surrogates.digest
        values = {**asdict(settings), "evaluation": self.cfg.scale.evaluation}
        return self._stamp("gan", name, values, inputs, "gan")

    def library(self, name: str) -> Stamp:
        """Of a variant's library."""
        inputs = {"gan": self.gan(name, self.cfg.gan[name]).digest}
        return self._stamp("library", name, self.cfg.library, inputs, "library")

    def long(self, harmonics: int) -> Stamp:
        """Of a single long trajectory."""
        values = {**asdict(self.cfg.long), "harmonics": harmonics, "count": self.cfg.selection.count}
        label = f"{self.cfg.long.period:g}s-{harmonics}h"
        return self._stamp("long", label, values, {"seeds": self.seeds.digest}, "seeds")

    def selection(self, name: str) -> Stamp:
        """Of the pick from the seeds (``seeds``) or from seeds and a variant's library."""
        inputs = {"seeds": self.seeds.digest}
        if name != "seeds":
            inputs["library"] = self.library(name).digest
        return self._stamp("selection", name, self.cfg.selection, inputs, "selection")

    @property
    def identification(self) -> Stamp:
        """Of the comparison of all excitation sets."""
        inputs = {f"selection {name}": self.selection(name).digest for name in ["seeds", *self.cfg.gan]}
        inputs |= {f"long {h}": self.long(h).digest for h in self.cfg.long.harmonics}
        label = "-".join(self.cfg.gan)
        return self._stamp("identification", label, self.cfg.identification, inputs, "identification")

    def _stamp(self, stage: str, label: str, values: Any, inputs: dict[str, str], room: str) -> Stamp:
        values = values if isinstance(values, dict) else asdict(values)
        shared = {"workspace": asdict(self.cfg.workspace), "trajectory": self.trajectory.describe()}
        inputs = {"robot": self.arm.digest, **inputs}
        code = [*_PHYSICS, room, "stages"]
        name = f"{self.arm.name}-{label}-seed{self.cfg.seed}"
        return self.store.stamp(stage, name, {**shared, stage: values}, inputs, code, self.cfg.seed)


def regions(workspace: config.Workspace) -> list[Region]:
    """The keep-out regions of a configured workspace."""
    made: list[Region] = []
    for region in workspace.regions:
        if region.plane is not None:
            made.append(Plane(region.plane.normal, region.plane.offset))
        if region.box is not None:
            made.append(Box(region.box.lower, region.box.upper))
    return made


def variant(name: str, settings: config.GanVariant) -> Variant:
    """The variant that ``settings`` describe."""
    values = {**asdict(settings), "weights": Weights(**asdict(settings.weights))}
    try:
        return Variant(name, **values)
    except ConfigError as error:
        raise ConfigError(f"gan.{name}: {error}") from error
