"""What the artifacts of conditioned generation are made from, beside ``plan``."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import torch

from sidegan.conditional import Condition, Request
from sidegan.conditional.ranges import NONE
from sidegan.conditional.space import ConditionSpace
from sidegan.errors import ConfigError, ShapeError
from sidegan.pipeline.plan import Task
from sidegan.pipeline.stamp import Stamp

STUDY = "study.json"
_CODE = ["gan", "seeds", "conditional", "plan_conditional", "stages.conditional"]


@dataclass(frozen=True)
class Conditions:
    """The configured conditions of a task, and the stamp of everything made for them."""

    task: Task

    @cached_property
    def space(self) -> ConditionSpace:
        """Conditions that the generator is trained for.

        Raises:
            ConfigError: when a range is impossible.
            InfeasibleError: when the arm has no home to start from.
        """
        ranges = self.task.cfg.conditional.ranges
        try:
            return ConditionSpace(self.task.constraints, self.task.trajectory, ranges)
        except ConfigError as error:
            raise ConfigError(f"conditional.ranges: {error}") from error

    @cached_property
    def asked(self) -> Condition | None:
        """The one condition that a library is wanted for, which the arm can meet; None for a study.

        Raises:
            ConfigError: when it names what the arm does not have, or lies outside of the ranges.
            InfeasibleError: when no arm can meet it.
        """
        ask = self.task.cfg.conditional.ask
        if ask is None:
            return None
        try:
            condition = self.space.condition(ask)
            self.space.refuse(condition)
        except (ConfigError, ShapeError) as error:
            raise ConfigError(f"conditional.ask: {error}") from error
        return condition

    def drawn(self, kind: str) -> Condition:
        """The conditions of one kind that are studied."""
        count = 1 if kind == NONE else self.task.cfg.conditional.study.conditions
        random = torch.Generator().manual_seed(self.task.number(f"conditions {kind}"))
        return self.space.draw(count, random, self.space.ranges.cases[kind])

    def dedicated(self) -> list[tuple[str, int]]:
        """Kind and number of every condition with a generator of its own; what asks for nothing has one.

        Raises:
            ConfigError: when a kind is to be compared that cannot be asked for.
        """
        wanted, known = self.task.cfg.conditional.study, self.space.ranges.cases
        for kind in wanted.compared:
            if kind not in known:
                raise ConfigError(
                    f"conditional.study.compared has {kind!r}, expected some of {', '.join(known)}"
                )
        kinds = [kind for kind in known if kind == NONE or kind in wanted.compared]
        return [(kind, k) for kind in kinds for k in range(1 if kind == NONE else wanted.dedicated)]

    @property
    def generator(self) -> Stamp:
        """Of the generator of all conditions."""
        return self._stamp("generator", self._trained(), {})

    def single(self, kind: str, number: int) -> Stamp:
        """Of a generator of one condition."""
        values = self._trained()
        values["training"]["epochs"] = self.task.cfg.conditional.study.epochs
        values["only"] = self.drawn(kind).row(number).describe()
        return self._stamp(f"{kind}-{number}", values, {})

    @property
    def study(self) -> Stamp:
        """Of what all of them are worth."""
        inputs = {f"{kind} {k}": self.single(kind, k).digest for kind, k in self.dedicated()}
        inputs["generator"] = self.generator.digest
        return self._stamp("study", asdict(self.task.cfg.conditional.study), inputs)

    @property
    def library(self) -> Stamp:
        """Of the trajectories for what is asked."""
        wanted = self.task.cfg.conditional
        values = {"count": wanted.count, "draws": wanted.draws, "ask": asdict(wanted.ask or Request())}
        return self._stamp("asked", values, {"generator": self.generator.digest})

    def _stamp(self, part: str, values: dict[str, Any], inputs: dict[str, str]) -> Stamp:
        return self.task.stamp("conditional", part, values, inputs, _CODE)

    def _trained(self) -> dict[str, Any]:
        wanted = self.task.cfg.conditional
        return {"ranges": asdict(wanted.ranges), "training": asdict(wanted.training)}
