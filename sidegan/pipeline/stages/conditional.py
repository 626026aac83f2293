"""Stage conditional: a generator for many conditions; how well they are met, or a library for one of them."""

from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import torch

from sidegan.base.storage import read_json, write_json
from sidegan.conditional import Condition, ConditionalGenerator, Request
from sidegan.conditional.settings import NONE
from sidegan.conditional.space import ConditionSpace
from sidegan.conditional.study import Study, validity
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.library.draw import draw_valid
from sidegan.library.measure import measured, summary
from sidegan.pipeline.graph import Artifact, Build, Metrics
from sidegan.pipeline.stage import Stage, finite
from sidegan.pipeline.stages.training import keep_history
from sidegan.pipeline.task import GENERATOR, LIBRARY, REPORT, Task, is_number

STUDY = "study.json"
_BATCH = 500  # trajectories drawn at once

Single = tuple[str, int]  # kind and number of a condition


@dataclass(frozen=True)
class Conditions:
    """The configured conditions of a task, and the artifacts that are made for them."""

    task: Task

    @cached_property
    def space(self) -> ConditionSpace:
        """The conditions that the generator is trained for."""
        try:
            return ConditionSpace(
                self.task.constraints, self.task.trajectory, self.task.cfg.conditional.ranges
            )
        except ConfigError as error:
            raise ConfigError(f"conditional.ranges: {error}") from error

    @cached_property
    def requested(self) -> Condition | None:
        """The one condition that a library is made for, which the arm can meet; None for a study."""
        request = self.task.cfg.conditional.ask
        if request is None:
            return None
        try:
            condition = self.space.condition(request)
            self.space.refuse(condition)
        except (ConfigError, ShapeError) as error:
            raise ConfigError(f"conditional.ask: {error}") from error
        return condition

    def drawn(self, kind: str) -> Condition:
        """The conditions of one kind that are studied."""
        count = 1 if kind == NONE else self.task.cfg.conditional.study.conditions
        random = torch.Generator().manual_seed(self.task.number(f"conditions {kind}"))
        return self.space.draw(count, random, self.space.ranges.cases[kind])

    @property
    def singles(self) -> list[Single]:
        """Every condition with a generator of its own; what asks for nothing has one."""
        study, kinds = self.task.cfg.conditional.study, self.space.ranges.cases
        for kind in study.compared:
            if kind not in kinds:
                raise ConfigError(
                    f"conditional.study.compared has {kind!r}, expected some of {', '.join(kinds)}"
                )
        compared = [kind for kind in kinds if kind == NONE or kind in study.compared]
        return [(kind, k) for kind in compared for k in range(1 if kind == NONE else study.dedicated)]

    def generator(self, single: Single | None = None) -> Artifact:
        """The generator of all conditions, or of one alone."""
        settings = self.task.cfg.conditional
        trained: dict[str, Any] = {"ranges": asdict(settings.ranges), "training": asdict(settings.training)}
        if single is not None:
            trained |= {
                "only": list(single),
                "of": settings.study.conditions,
                "epochs": settings.study.epochs,
            }
        label = "generator" if single is None else f"{single[0]}-{single[1]}"
        return self.task.artifact(
            "conditional", label, partial(_train, single=single), trained, title=f"conditional/{label}"
        )

    @property
    def study(self) -> Artifact:
        """What all generators are worth."""
        inputs = {f"{kind} {k}": self.generator((kind, k)) for kind, k in self.singles}
        inputs["generator"] = self.generator()
        settings = self.task.cfg.conditional.study
        return self.task.artifact("conditional", "study", _study, settings, inputs, metrics=_kinds)

    @property
    def library(self) -> Artifact:
        """Trajectories for what is requested."""
        settings = self.task.cfg.conditional
        values = {"count": settings.count, "draws": settings.draws, "ask": asdict(settings.ask or Request())}
        inputs, title = {"generator": self.generator()}, "conditional/asked"
        return self.task.artifact("conditional", "asked", _fill, values, inputs, title=title)


def _artifacts(task: Task) -> list[Artifact]:
    conditions = Conditions(task)
    if conditions.requested is not None:
        return [conditions.generator(), conditions.library]
    return [conditions.generator(), *map(conditions.generator, conditions.singles), conditions.study]


def _kinds(folder: Path) -> Metrics:
    rows = read_json(folder / STUDY)["kinds"]
    return {f"{row['kind']}/{key}": x for row in rows for key, x in row.items() if is_number(x)}


def _train(task: Task, build: Build, single: Single | None) -> None:
    from sidegan.conditional.training import train

    conditions, settings = Conditions(task), task.cfg.conditional.training
    only, name = None, "conditional"
    if single is not None:
        kind, number = single
        settings = replace(settings, epochs=task.cfg.conditional.study.epochs)
        only, name = conditions.drawn(kind).row(number), f"conditional {kind} {number}"
    trained = train(
        conditions.space,
        settings,
        build.work,
        task.number(name),
        only,
        lambda epoch, _: build.report(epoch + 1, settings.epochs),
    )
    trained.generator.save(build.folder / GENERATOR)
    keep_history(build, trained.history)


def _load(conditions: Conditions, single: Single | None = None) -> ConditionalGenerator:
    task = conditions.task
    path = task.store.require(conditions.generator(single)) / GENERATOR
    return ConditionalGenerator.load(path, task.constraints)


def _study(task: Task, build: Build) -> None:
    conditions = Conditions(task)
    singles = {one: _load(conditions, one) for one in conditions.singles}
    study = Study(_load(conditions), singles, task.cfg.conditional.study, task.number)
    tables = study.tables({kind: conditions.drawn(kind) for kind in conditions.space.ranges.cases})
    write_json(build.folder / STUDY, {name: [finite(row) for row in rows] for name, rows in tables.items()})


def _fill(task: Task, build: Build) -> None:
    """A library of valid trajectories for what is requested."""
    conditions, settings = Conditions(task), task.cfg.conditional
    condition, generator = conditions.requested, _load(conditions)
    assert condition is not None  # the artifact is of a request
    noise = torch.Generator().manual_seed(task.number("conditional library"))
    draws = draw_valid(
        lambda count: generator.sample(count, condition, noise)[1],
        partial(validity, generator, condition),
        settings.count,
        _BATCH,
        settings.draws,
    )
    if not draws.valid:
        raise InfeasibleError(
            f"none of {draws.drawn} trajectories drawn for {condition.describe()} is valid: "
            "it leaves the arm no room"
        )
    draws.require(1, f"drawn for {condition.describe()}")
    family = condition.family(task.trajectory)
    library = measured(condition.constraints(task.constraints), family, draws.coefficients, "conditional")
    library.save(build.folder / LIBRARY)
    share = {"drawn": draws.drawn, "valid_share": draws.valid / draws.drawn}
    facts = {key: x for key, x in summary(library).items() if key != "valid"}
    write_json(build.folder / REPORT, {**share, "condition_asked": condition.describe(), **facts})


STAGE = Stage(_artifacts)
