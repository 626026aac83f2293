"""The configured arm, workspace and trajectories, and the artifacts that are made for them."""

import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import psutil
from torch import Tensor

from sidegan.base.names import counted, folder_name, listed
from sidegan.base.storage import read_json
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError
from sidegan.library import Library
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact, Build, Metrics
from sidegan.pipeline.compose import composed
from sidegan.pipeline.settings import Config
from sidegan.pipeline.store import Store
from sidegan.robot import (
    Arm,
    doubtful_links,
    load_robot,
    tell_doubtful,
    tell_placeholder_links,
    with_effort,
)
from sidegan.robot.setup import allowed
from sidegan.validity import Constraints, Validity, check, usual_effort
from sidegan.validity.home import refuse_degrees
from sidegan.validity.pairs import room_between, tell_displaced
from sidegan.validity.placeholders import tell_friction, tell_placeholders, tell_weak

log = logging.getLogger(__name__)

LIBRARY, GENERATOR, HISTORY, REPORT = "library.parquet", "generator.pt", "history.json", "report.json"
RESULTS, FACTS, EXPECTED = "results.parquet", "facts.parquet", "expected.parquet"

_homes: dict[tuple[str, ...], tuple[float, ...] | None] = {}  # found before, by arm and workspace
_SAMPLES = 60  # time points per period of an optimisation
_SAME = 1e-9  # [rad or m] to the middle of the limits, that home counts as there


@dataclass(frozen=True)
class Task:
    """Context of a run: its settings, its artifacts, and the arm in its workspace."""

    cfg: Config
    store: Store
    overrides: tuple[str, ...] = ()  # of the command, from which other conditions are composed

    @cached_property
    def arm(self) -> Arm:
        """The arm, with the share of its limits that may be used."""
        return with_effort(self.whole_arm, self.effort)

    @cached_property
    def effort(self) -> float:
        """Share of the velocity and torque limits that may be used."""
        arm, stated = self.whole_arm, self.cfg.robot.effort
        return usual_effort(arm, self._stated_home) if stated is None else stated

    @cached_property
    def whole_arm(self) -> Arm:
        """The arm with all of its limits."""
        robot = self.cfg.robot
        return load_robot(robot.name, robot.setup, self._stated_home, self.planning)

    @property
    def planning(self) -> bool:
        """Whether motions of the arm are planned."""
        return self.cfg.has("workspace")

    @property
    def _stated_home(self) -> list[float] | None:
        return self.cfg.trajectory.home if self.cfg.has("trajectory") else None

    @cached_property
    def home(self) -> list[float] | None:
        """Home position [rad or m], (J,): as configured, as described, or found; None for zeros."""
        if self.cfg.trajectory.home is not None:
            return self.cfg.trajectory.home
        key = (self.arm.digest, repr(self.arm.home), repr(self.cfg.workspace))
        if key not in _homes:
            _homes[key] = self.cfg.workspace.home_of(self.arm, self.arm.home)
        found = _homes[key]
        return None if found is None else list(found)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The family of the short trajectories."""
        family = self.cfg.trajectory
        return Trajectory(self.arm.joints, family.harmonics, family.period, self.home)

    @cached_property
    def _workspace(self) -> Constraints:
        """The arm in its workspace."""
        return self.cfg.workspace.around(self.arm, self.home or [0.0] * self.arm.joints)

    @cached_property
    def constraints(self) -> Constraints:
        """The arm in its workspace; the home position is checked."""
        refuse_degrees(self.arm, self.trajectory.home or (), "trajectory.home")
        self._workspace.refuse_home(self.trajectory.home or ())
        return self._workspace

    def tell(self) -> None:
        """Say what of the description moves, what trajectories are checked for, and what is suspicious."""
        if notes := self.whole_arm.notes:
            log.info("%s: %s", self.whole_arm.name, "; ".join(notes))
        if self.planning:
            for text in filter(None, self._doubts()):
                log.warning("%s", text)
            for text in filter(None, self._decisions()):
                log.info("%s", text)
        elif placeholders := tell_placeholder_links(self.whole_arm):
            log.warning("%s: they are no prior and no reference", placeholders)

    def _doubts(self) -> Iterator[str]:
        """Where the description tells suspiciously little or much."""
        arm, constraints = self.arm, self.constraints
        yield tell_placeholders(self.whole_arm)
        if self.cfg.workspace.torque:
            yield tell_weak(self.whole_arm)
            yield tell_friction(self.whole_arm)
        yield self._touching()
        yield tell_displaced(arm)
        masses = tell_doubtful(arm)
        if masses and not arm.inertial_parameters.any():
            masses += "; torques are not known: their limits are not checked, nor peaks told"
        elif masses:
            last = max(map(arm.link_names.index, doubtful_links(arm)))
            moved = listed(arm.joint_names[: last + 1])
            masses += f"; torques of {moved} may be far from what is checked and told"
        yield masses
        if placeholders := tell_placeholder_links(arm):
            yield (
                f"{placeholders}: torques, their limits, energies and what a set leaves uncertain mean "
                "nothing until a model is identified; goal.objective=condition needs no masses"
            )
        if constraints.arm.capsules.points:
            yield f"{arm.name} has no collision shapes: its joint origins alone keep out of regions"

    def _touching(self) -> str:
        """Links that touch in most configurations; empty where there are none."""
        touching = room_between(self.constraints.arm, 0.0).touching
        said = listed([f"{' – '.join(links)} in {share:.0%}" for links, share in touching.items()])
        if not said:
            return ""
        return (
            f"links that touch in most configurations: {said}; correct their shapes, or, if nothing is "
            f"wrong with their touching, {allowed(touching, self.arm.setup.may_touch)} leaves them unchecked"
        )

    def _decisions(self) -> Iterator[str]:
        """Decisions made for the user, and what trajectories are checked for."""
        arm, cfg, home, constraints = self.arm, self.cfg, self.home, self.constraints
        yield cfg.workspace.notes(arm)
        if cfg.trajectory.home is None and (home is not None or arm.home is not None):
            place, own = ", ".join(f"{x:g}" for x in self.trajectory.home or ()), arm.home
            if own is not None and list(own) == home:
                why = "home is where the description has the arm rest:"
            else:
                why = f"{'zeros are' if own is None else 'its own is'} no feasible home; home is"
            yield f"{why} {place}, or where trajectory.home=… says"
        if cfg.robot.effort is None:
            why = "" if self.effort < 1 else ", since less would hardly hold the arm"
            share = f"{self.effort:.0%} of the velocity and torque limits{why}"
            yield f"effort: {share}; robot.effort=… says another"
        yield self._friction()
        if cfg.workspace.clearance is None and not constraints.arm.capsules.points:
            yield f"kept clear: {constraints.kept_clear}; workspace.clearance=… says another distance"
        yield f"checked: {constraints.described()}"

    def _friction(self) -> str:
        """What torque limits are checked with, where they are, of friction and rotors; empty otherwise."""
        if not self.constraints.torque or not self.cfg.robot.friction:
            return ""
        if self.arm.drives is None:
            free = f"{1 - self.effort:.0%} of the torque limits that are kept free are for it"
            return f"the description states no friction: the {free}" if self.effort < 1 else ""
        each = vars(self.arm.drives).values()
        viscous, dry, rotors = (int((x > 0).sum()) for x in each)
        return (
            f"torques count the description's damping of {viscous}, friction of {dry} and armature "
            f"of {counted(rotors, 'joint')}; robot.friction=false leaves it out"
        )

    def check(self, c: Tensor) -> Validity:
        """Whether short trajectories, (B, J, H, 2), are valid."""
        return check(self.constraints, self.trajectory, c)

    @property
    def problem(self) -> Problem:
        """The optimisation of short trajectories with the usual samples, or as many as see all harmonics."""
        samples = max(_SAMPLES, 2 * self.trajectory.harmonics + 1)
        return Problem(self.constraints, self.trajectory, samples)

    @property
    def body(self) -> RigidBody:
        """Dynamics of the arm."""
        return self.constraints.body

    def with_settings(self, **changes: Any) -> "Task":
        """A copy with other settings, by their name in the configuration."""
        return replace(self, cfg=replace(self.cfg, stages=[], **changes))

    def with_other(self, group: str, name: str) -> "Task":
        """A copy with another choice of a group: a condition, an arm."""
        kept = [one for one in self.overrides if one.partition("=")[0] != group]
        return replace(self, cfg=composed(*kept, f"{group}={name}"))

    def require_room(self, count: int, setting: str) -> None:
        """Refuse a setting by which there would be more trajectories than fit into memory."""
        needed = 8 * count * self.arm.joints * 2 * self.cfg.trajectory.harmonics
        there = psutil.virtual_memory().total
        if needed > there:
            raise ConfigError(
                f"{setting} takes {needed / 1e9:.3g} GB in memory, this machine has {there / 1e9:.3g} GB"
            )

    def random(self, purpose: str, training: int | None = None) -> np.random.SeedSequence:
        """The random numbers of one purpose, independent of all others."""
        return np.random.SeedSequence([self.cfg.seed, *purpose.encode(), *([training] if training else [])])

    def number(self, purpose: str, training: int | None = None) -> int:
        """One random seed for ``purpose``."""
        return int(self.random(purpose, training).generate_state(1)[0] & 0x7FFF_FFFF)

    def artifact(
        self,
        maker: str,
        label: str,
        make: Callable[["Task", Build], None],
        settings: Any,
        inputs: Mapping[str, Artifact | str] | None = None,
        **options: Any,
    ) -> Artifact:
        """An artifact that depends on the arm in its workspace, on its trajectories, and on so much more.

        Args:
            maker: who makes it.
            label: what tells it from its siblings.
            make: fills its folder, ``make(task, build)``.
            settings: a dataclass of those it depends on besides, or a mapping of plain values.
            inputs: what it is made from, beside the arm.
            options: ``training`` where there are several, and of ``Artifact`` ``metrics``, ``alone`` and
                ``title`` (maker, label and which of several trainings when missing).
        """
        own = settings if isinstance(settings, Mapping) else asdict(settings)
        family = {**asdict(self.cfg.trajectory), "home": self.home}
        middle = (self.arm.position_lower + self.arm.position_upper) / 2
        away = (middle - middle.new_tensor(self.trajectory.home)).nan_to_num().abs().max()
        if away >= _SAME:  # since 2 joints go as far as their limits on either side of home
            family["rooms"] = 2
        parts, title, numbered = [self.arm.name, label, f"seed{self.cfg.seed}"], f"{maker}/{label}", {}
        if (training := options.get("training")) is not None:
            parts.append(f"training{training}")
            numbered = {"training": training}
            title += f"-{training}" if len(self.cfg.trainings) > 1 else ""
        if own.get("subset") is not None:
            parts.append(f"of{own['subset']}")
        shared = {"workspace": self.cfg.workspace.stamped(self.arm), "trajectory": family}
        return Artifact(
            maker,
            folder_name("-".join(parts)),
            options.get("title", title),
            {**shared, **numbered, maker: own},
            {"robot": self.arm.digest, **(inputs or {})},
            self.cfg.seed,
            partial(make, self),
            options.get("metrics", report_and_history),
            options.get("alone", False),
        )

    def report(self, artifact: Artifact) -> dict[str, Any]:
        """Report in an artifact that must be there."""
        return read_json(self.store.require(artifact) / REPORT)

    def history(self, artifact: Artifact) -> list[dict[str, float | None]]:
        """Metrics after every epoch of a training that must be there."""
        return read_json(self.store.require(artifact) / HISTORY)

    def load(self, artifact: Artifact, *others: Artifact) -> Library:
        """Trajectories in artifacts that must be there, one after the other."""
        first, *more = (self.store.require(one) / LIBRARY for one in (artifact, *others))
        return Library.load(first, self.arm, *more)

    def frame(self, artifact: Artifact, file: str = RESULTS) -> pd.DataFrame:
        """Table in an artifact that must be there."""
        return pd.read_parquet(self.store.require(artifact) / file)


def report_and_history(folder: Path) -> Metrics:
    """Numbers and series in the report of an artifact, and the series of its history, where it has them."""
    report = read_json(folder / REPORT) if (folder / REPORT).exists() else {}
    rows = read_json(folder / HISTORY) if (folder / HISTORY).exists() else []
    recorded = {key: x for key, x in report.items() if isinstance(x, int | float | list)}
    return recorded | ({key: [row[key] for row in rows] for key in rows[0]} if rows else {})
