"""Context of a run: settings, random numbers, the arm in its cell, and artifacts."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.names import folder_name
from sidegan.base.random import number, stream
from sidegan.base.storage import read_json
from sidegan.cell import Cell
from sidegan.cell.cell import describe_notes
from sidegan.library import LIBRARY, Library
from sidegan.pipeline.artifact import Artifact, Build, Metrics
from sidegan.pipeline.compose import composed
from sidegan.pipeline.settings import Config
from sidegan.pipeline.store import Store
from sidegan.robot import describe_placeholder_links
from sidegan.robot.consistency import describe_other_units

_log = logging.getLogger(__name__)

GENERATOR, HISTORY, REPORT = "generator.pt", "history.json", "report.json"
RESULTS, FACTS, EXPECTED = "results.parquet", "facts.parquet", "expected.parquet"


def report_and_history(folder: Path) -> Metrics:
    """Numbers and series in an artifact's report, and the series of its history, if it has these files."""
    report = read_json(folder / REPORT) if (folder / REPORT).exists() else {}
    rows = read_json(folder / HISTORY) if (folder / HISTORY).exists() else []
    recorded = {key: x for key, x in report.items() if isinstance(x, int | float | list)}
    return recorded | ({key: [row[key] for row in rows] for key in rows[0]} if rows else {})


@dataclass(frozen=True)
class RunContext:
    """Context of a run: settings, random numbers, the arm in its cell, and artifacts."""

    cfg: Config
    store: Store
    overrides: tuple[str, ...] = ()  # of the command; other conditions are composed from them

    @cached_property
    def cell(self) -> Cell:
        """The arm in its cell, as configured."""
        cfg = self.cfg
        robot = self.cfg.robot
        planned = {"workspace": cfg.workspace, **asdict(cfg.trajectory)} if self.planning else {}
        return Cell(robot.name, effort=robot.effort, **planned, **asdict(robot.setup))

    @property
    def planning(self) -> bool:
        """Whether the run plans motions of the arm."""
        return self.cfg.has("workspace")

    def log_decisions(self) -> None:
        """Log warnings about the description, and the defaults that were chosen for the user."""
        if self.planning:
            warnings, notes = self.cell.warnings, self.cell.notes
        else:
            placeholders = describe_placeholder_links(arm := self.cell.recorded_arm)
            warnings = [f"{placeholders}: they are not used as prior or reference"] if placeholders else []
            warnings += filter(None, [describe_other_units(arm)])
            notes = describe_notes(arm)
        for text in warnings:
            _log.warning("%s", text)
        for text in notes:
            _log.info("%s", text)

    def with_settings(self, **changes: Any) -> "RunContext":
        """A copy with changed settings, by their names in the configuration."""
        return replace(self, cfg=replace(self.cfg, stages=[], **changes))

    def with_changes(self, *changes: str) -> "RunContext":
        """A copy with other overrides of the command, such as condition=published or gan.eigen.epochs=9.

        A change replaces earlier overrides of its key; that of a group also replaces its name, as
        robot=planar2 does with robot.name=arm.urdf.
        """
        words = list(self.overrides)
        for change in changes:
            key = change.partition("=")[0]
            added = any(word.startswith(f"+{key}=") for word in words)  # to an experiment without this group
            replaced = {key, f"{key}.name"}
            words = [word for word in words if word.partition("=")[0].lstrip("+") not in replaced]
            words.append(f"+{change}" if added else change)
        return replace(self, cfg=composed(*words))

    def random(self, purpose: str, training: int | None = None) -> np.random.SeedSequence:
        """Random seed sequence for a purpose, independent of all others."""
        return stream(self.cfg.seed, purpose, training)

    def number(self, purpose: str, training: int | None = None) -> int:
        """Random seed for a purpose."""
        return number(self.cfg.seed, purpose, training)

    def artifact(
        self,
        maker: str,
        label: str,
        make: Callable[["RunContext", Build], None],
        settings: Any,
        inputs: Mapping[str, Artifact | str] | None = None,
        training: int | None = None,
        title: str | None = None,
        metrics: Callable[[Path], Metrics] = report_and_history,
        alone: bool = False,
    ) -> Artifact:
        """An artifact that depends on the arm in its workspace, the trajectory family, and ``settings``.

        Arguments are those of ``Artifact``; ``training`` is the number of one of a variant's trainings. The
        title is by default maker and label, with the training's number if the run has several; the size of
        a subset is added.
        """
        values = settings if isinstance(settings, Mapping) else asdict(settings)
        arm = self.cell.arm
        parts = [arm.name, label, f"seed{self.cfg.seed}"]
        stamped = self.cell.stamped()
        if training is not None:
            parts.append(f"training{training}")
            stamped["training"] = training
        if title is None:
            several = training is not None and len(self.cfg.trainings) > 1
            title = f"{maker}/{label}-{training}" if several else f"{maker}/{label}"
        if values.get("subset") is not None:
            parts.append(f"of{values['subset']}")
            title += f"-of{values['subset']}"
        return Artifact(
            maker=maker,
            label=folder_name("-".join(parts)),
            title=title,
            settings=stamped | {maker: values},
            inputs={"robot": arm.digest, **(inputs or {})},
            seed=self.cfg.seed,
            make=partial(make, self),
            metrics=metrics,
            alone=alone,
        )

    def report(self, artifact: Artifact) -> dict[str, Any]:
        """Report of an artifact, which must exist."""
        return read_json(self.store.require(artifact) / REPORT)

    def history(self, artifact: Artifact) -> list[dict[str, float | None]]:
        """Metrics after every epoch of a training, which must exist."""
        return read_json(self.store.require(artifact) / HISTORY)

    def load(self, artifact: Artifact, *others: Artifact) -> Library:
        """Trajectories of artifacts, which must exist, one after the other."""
        first, *rest = (self.store.require(source) / LIBRARY for source in (artifact, *others))
        return Library.load(first, self.cell.arm, *rest)

    def frame(self, artifact: Artifact, file: str = RESULTS) -> pd.DataFrame:
        """Table of an artifact, which must exist."""
        return pd.read_parquet(self.store.require(artifact) / file)
