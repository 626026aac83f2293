"""From configured files to recordings that were checked and conditioned."""

import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import torch

from sidegan.identification import Measurements
from sidegan.pipeline import config_identify
from sidegan.pipeline.config import Config
from sidegan.recording import Columns, Findings, Segment, Settings, Source, Units, examine
from sidegan.robot import Arm

log = logging.getLogger(__name__)

Role = Literal["training", "validation"]


@dataclass(frozen=True, eq=False)
class Examined:
    """A recording that was checked and conditioned.

    Attributes:
        role: what it is for.
        joint_names: of the arm.
        findings: of the check.
        segments: conditioned stretches.
    """

    role: Role
    joint_names: tuple[str, ...]
    findings: Findings
    segments: list[Segment]

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.findings.survey.name

    @property
    def measurements(self) -> list[Measurements]:
        """A stretch each."""
        return [Measurements(*segment[1:]) for segment in self.segments]

    @property
    def whole(self) -> Measurements:
        """All stretches as one."""
        return Measurements(*(torch.cat(x) for x in zip(*(segment[1:] for segment in self.segments))))


def examined(cfg: Config, arm: Arm, files: Sequence[str], role: Role) -> list[Examined]:
    """Recordings, read, checked and conditioned; what is odd about them is logged."""
    found = []
    for name in files:
        source = Source(Path(name), columns_of(cfg.recording), arm.joint_names, cfg.recording.rows)
        findings, segments = examine(source, arm, settings_of(cfg), cfg.recording.units.angle)
        log.info(
            "%s: %d samples in %.4g s, %s", name, findings.survey.samples, findings.survey.duration, role
        )
        log.info("  %s", findings.grid.statement)
        for warning in findings.warnings:
            log.warning("%s: %s", name, warning)
        found.append(Examined(role, arm.joint_names, findings, segments))
    return found


def columns_of(recording: config_identify.Recording) -> Columns:
    """Which column is what, as plain values."""
    names = ("time", "position", "velocity", "acceleration", "torque", "current", "joints", "topic", "effort")
    units = Units(**asdict(recording.units))
    return Columns(**{name: getattr(recording, name) for name in names}, units=units)


def settings_of(cfg: Config) -> Settings:
    """How recordings are conditioned, as plain values."""
    names = ("bandwidth", "cutoff", "headroom", "order", "oversampling", "gap", "still", "pause")
    gains = None if cfg.robot.gains is None else tuple(cfg.robot.gains)
    values = {name: getattr(cfg.recording, name) for name in names}
    reverse, width = tuple(cfg.recording.reverse), cfg.model.sign_width
    return Settings(**values, gains=gains, reverse=reverse, sign_width=width)
