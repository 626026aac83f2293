"""Check of a recording before anything is fitted to it: is it plausible, and what can it tell?"""

import logging
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import torch
from torch import Tensor

from sidegan.errors import RecordingError
from sidegan.motion.dynamics import RigidBody
from sidegan.recording import plausibility
from sidegan.recording.description import Agreement, Excitation, agreement_of, excitation_of
from sidegan.recording.load import Source
from sidegan.recording.recording import SIGN_WIDTH, Recording, Segment
from sidegan.recording.segments import Grid, grid_for, preprocess
from sidegan.recording.settings import Preprocessing, RecordingSettings
from sidegan.recording.statistics import Statistics, statistics_of
from sidegan.robot import Arm

log = logging.getLogger(__name__)

Role = Literal["training", "validation"]
_LEAST_NOISE = 1e-6  # of a joint's torque
_LISTED = 100  # corrupt rows


@dataclass(frozen=True, eq=False)
class CheckedRecording:
    """A recording that was checked and preprocessed."""

    role: Role  # what it is for
    joint_names: tuple[str, ...]  # of the arm
    statistics: Statistics  # of the raw recording
    grid: Grid  # what it was preprocessed with
    segments: list[Segment]  # preprocessed stretches
    agreement: Agreement  # of the torques with the arm's description
    excitation: Excitation  # of each base parameter
    warnings: list[str]  # what a person should look at

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.statistics.name

    @property
    def kept(self) -> int:
        """Number of samples that are left for identification."""
        return sum(len(segment.time) for segment in self.segments)

    @property
    def moving(self) -> float:
        """Time that they cover [s]."""
        return sum(float(segment.time[-1] - segment.time[0]) for segment in self.segments)

    @property
    def derived(self) -> list[str]:
        """Signals that were not recorded, and are derivatives of others."""
        return [name for name in ("velocity", "acceleration") if name not in self.statistics.signals]

    def as_json(self) -> dict[str, Any]:
        """All of it but the samples, as plain values."""
        raw = self.statistics
        signals = {
            name: {key: x.tolist() for key, x in vars(signal).items()} for name, signal in raw.signals.items()
        }
        reasons = dict(Counter(reason for _, reason in raw.corrupt).most_common())
        return {
            "name": raw.name,
            "samples": raw.samples,
            "duration": raw.duration,
            "rate": 1 / raw.step,
            "jitter": raw.jitter,
            "duplicates": raw.duplicates,
            "gaps": [list(gap) for gap in raw.gaps],
            "corrupt": {"count": len(raw.corrupt), "reasons": reasons},
            "corrupt_rows": [list(row) for row in raw.corrupt[:_LISTED]],
            "signals": signals,
            "derived": self.derived,
            "conditioning": {**asdict(self.grid), "statement": self.grid.statement},
            "kept": self.kept,
            "moving": self.moving,
            "sign": self.agreement.sign.tolist(),
            "lag": self.agreement.lag,
            "condition": self.excitation.condition_number,
            "excited": self.excitation.rows,
            "weak": self.excitation.weak,
            "warnings": self.warnings,
        }


def read_and_check(
    files: Sequence[str],
    role: Role,
    arm: Arm,
    settings: RecordingSettings,
    gains: Sequence[float] | None = None,
    sign_width: float = SIGN_WIDTH,
) -> list[CheckedRecording]:
    """Recordings of files, checked and preprocessed; what is odd about them is logged.

    Arguments and errors are those of ``check_recording``.
    """
    recordings = []
    for file in files:
        source = Source(Path(file), settings, arm.joint_names, settings.rows)
        checked = check_recording(source, arm, settings, gains, sign_width, settings.units.angle, role)
        raw = checked.statistics
        log.info("%s: %d samples in %.4g s, %s", file, raw.samples, raw.duration, role)
        log.info("  %s", checked.grid.statement)
        for warning in checked.warnings:
            log.warning("%s: %s", file, warning)
        recordings.append(checked)
    return recordings


def check_recording(
    recording: Recording | Iterable[Recording],
    arm: Arm,
    settings: Preprocessing,
    gains: Sequence[float] | None = None,
    sign_width: float = SIGN_WIDTH,
    angle: str = "rad",
    role: Role = "training",
) -> CheckedRecording:
    """A recording, checked and preprocessed.

    Its torques are compared with the arm's description. ``angle`` is the unit that the file's angles were
    declared in; the other arguments are those of ``preprocess``, and a recording in pieces is walked through
    twice.

    Raises:
        RecordingError: when the recording cannot be used: time runs backwards, nothing moves, torques are
            zero or constant, positions are in another unit than declared.
    """
    statistics = statistics_of(recording, settings.gap)
    joints = len(statistics.signals["position"].lower)
    if joints != arm.joints:
        raise RecordingError(f"{statistics.name} has {joints} joints, {arm.name} has {arm.joints}")
    plausibility.refuse_wrong_units(statistics, arm, angle)
    plausibility.refuse_idle(statistics)
    grid = grid_for(statistics, settings)
    segments = preprocess(recording, settings, gains, sign_width, grid)
    body = RigidBody(arm)
    warnings = plausibility.clock_warnings(statistics) + plausibility.range_warnings(statistics, arm)
    warnings += plausibility.velocity_warnings(statistics, arm, segments)
    agreement = agreement_of(body, segments)
    excitation = excitation_of(body, segments, _torque_noise(statistics, segments, gains))
    warnings += agreement.warnings(arm) + excitation.warnings()
    return CheckedRecording(
        role, arm.joint_names, statistics, grid, segments, agreement, excitation, warnings
    )


def _torque_noise(statistics: Statistics, segments: list[Segment], gains: Sequence[float] | None) -> Tensor:
    """Noise floor of each joint's torque [N·m or N], (J,)."""
    if "torque" in statistics.signals:
        noise = statistics.signals["torque"].noise
    else:
        noise = statistics.signals["current"].noise * torch.tensor(gains, dtype=torch.float64)
    size = torch.cat([segment.torque for segment in segments]).square().mean(0).sqrt()
    return torch.maximum(noise, _LEAST_NOISE * size.max())
