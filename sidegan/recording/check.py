"""Plausibility check and preprocessing of recordings before identification."""

import logging
import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.errors import RecordingError
from sidegan.motion.dynamics import RigidBody
from sidegan.recording import plausibility, refused
from sidegan.recording.agreement import Agreement, agreement_of
from sidegan.recording.commanded import Repeated, averaged, load_commanded
from sidegan.recording.delay import Delay, measured, pooled
from sidegan.recording.grid import Grid, noise_of
from sidegan.recording.load import recording_name
from sidegan.recording.mended import steadied
from sidegan.recording.overlap import same_run
from sidegan.recording.recording import SIGN_WIDTH, Recording, Segment
from sidegan.recording.segments import grid_for, preprocess, torque_of
from sidegan.recording.settings import Files, Recorded, RecordingSettings
from sidegan.recording.stationary import load_for
from sidegan.recording.statistics import Statistics, statistics_of
from sidegan.robot import Arm

log = logging.getLogger(__name__)

Role = Literal["training", "validation", "loaded"]  # loaded: with a load that the description lacks
_LEAST_PART = 20  # samples in each part of a split recording
_UNUSED_GAINS = (
    "robot.gains is not used, since torques were recorded; if they are currents: recording.effort=current "
    "for columns of efforts, recording.torque=null 'recording.current=\"tau{index}\"' for columns like tau1"
)


@dataclass(frozen=True, eq=False)
class CheckedRecording:
    """A checked and preprocessed recording."""

    joint_names: tuple[str, ...]  # of the arm
    statistics: Statistics  # of the raw recording
    grid: Grid
    segments: list[Segment]
    agreement: Agreement
    warnings: list[str]
    faults: list[str]  # the warnings about saturated or frozen torques
    remarks: dict[str, str]  # the warnings about unused, contradictory signals, by signal
    twice: list[str]  # the warnings about joints with the same column
    late: str | None  # warning about a clear but uncorrected delay
    delay: Delay  # of the torques
    corrected: bool  # whether the delay was removed
    noise: Array  # torque noise density [(N·m)²/Hz or N²/Hz], (J,); NaN if undetermined
    repeated: Repeated | None = None  # commanded trajectories found, if known
    role: Role = "training"
    copied: str | None = None  # warning that it is the same run as a training recording

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.statistics.name

    @property
    def kept(self) -> int:
        """Number of samples left for identification."""
        return sum(len(segment.time) for segment in self.segments)

    @property
    def moving(self) -> float:
        """Total duration of the segments [s]."""
        return sum(float(segment.time[-1] - segment.time[0]) for segment in self.segments)

    @property
    def statements(self) -> list[str]:
        """Sentences on how it was preprocessed."""
        found = [] if self.repeated is None else [self.repeated.statement]
        delay = self.delay.statement(self.corrected)
        return [self.grid.statement, *found, *([delay] if delay not in self.warnings else [])]

    @property
    def derived(self) -> list[str]:
        """Signals computed as derivatives because they were not recorded."""
        return [name for name in ("velocity", "acceleration") if name not in self.statistics.signals]

    def as_json(self) -> dict[str, Any]:
        """Everything but the samples, as plain values."""
        raw = self.statistics
        repeated = self.repeated
        same = ("name", "samples", "duration", "jitter", "duplicates", "gaps", "frozen")
        return {
            **{key: getattr(raw, key) for key in same},
            "rate": 1 / raw.step,
            "corrupt": Counter(reason for _, reason in raw.corrupt),
            "signals": {
                name: {key: x.tolist() for key, x in signal._asdict().items()}
                for name, signal in raw.signals.items()
            },
            "derived": self.derived,
            "conditioning": {**asdict(self.grid), "statement": self.grid.statement},
            "kept": self.kept,
            "moving": self.moving,
            "sign": self.agreement.sign.tolist(),
            "delay": {key: x if math.isfinite(x) else None for key, x in self.delay._asdict().items()},
            "repetitions": None if repeated is None else repeated.counts,
            "noise": None if repeated is None or repeated.noise is None else repeated.noise.tolist(),
            "warnings": self.warnings,
        }


def split(recording: CheckedRecording, share: float) -> tuple[CheckedRecording, CheckedRecording]:
    """The first part of a recording, for training, and the last ``share`` of it, for validation.

    Samples between them that the low-pass mixes are left out.
    """
    mixed = round(recording.grid.rate / recording.grid.cutoff)
    end = round((1 - share) * recording.kept)
    first = _part(recording, "training", f"first {1 - share:.0%}", 0, end - mixed)
    last = _part(recording, "validation", f"last {share:.0%}", end, recording.kept)
    if min(first.kept, last.kept) < _LEAST_PART:
        raise RecordingError(f"{recording.name} is too short to hold out {share:.0%} of it")
    return first, last


def _part(recording: CheckedRecording, role: Role, which: str, first: int, last: int) -> CheckedRecording:
    """Kept samples ``first`` to ``last`` of a recording."""
    parts = []
    begin = 0
    for segment in recording.segments:
        inside = slice(max(0, first - begin), max(0, last - begin))
        begin += len(segment.time)
        parts.append(Segment(*(x[inside] for x in segment)))
    segments = [part for part in parts if len(part.time) > 1]
    statistics = replace(recording.statistics, name=f"{recording.name}, {which}")
    return replace(recording, role=role, segments=segments, statistics=statistics)


def read_and_check(
    files: Sequence[tuple[Recorded, Role]],
    arm: Arm,
    settings: RecordingSettings,
    gains: Sequence[float] | None = None,
    sign_width: float = SIGN_WIDTH,
    folder: str = "",
) -> list[CheckedRecording]:
    """Recordings read from files, checked and preprocessed; oddities are logged.

    All are assumed to have the same torque delay. See ``check_recording`` for arguments and errors; names in
    the log begin after ``folder``.
    """
    read = [load_for(arm, file, settings) for file, _ in files]
    found = [check_recording(recording, arm, settings, gains, sign_width) for recording in read]
    common = pooled([checked.delay for checked in found])
    if common is not None and settings.delay is None:
        found = [check_recording(x, arm, settings, gains, sign_width, common) for x in read]
    elif common is not None:
        found = [replace(checked, delay=common) for checked in found]
    found = [replace(checked, role=role) for checked, (_, role) in zip(found, files)]
    found = [_compared(checked, found[:k]) for k, checked in enumerate(found)]
    for checked in found:
        if checked.role == "loaded":  # the runs without the load show what contradicts the description
            contradictions = checked.agreement.warnings(arm)
            checked.warnings[:] = [x for x in checked.warnings if x not in contradictions]
    warned = defaultdict[str, list[str]](list)
    for (file, role), checked in zip(files, found):
        name = recording_name(file) if isinstance(file, Files) else file.removeprefix(folder)
        raw = checked.statistics
        log.info("%s: %d samples in %.4g s, %s", name, raw.samples, raw.duration, role)
        for statement in checked.statements:
            log.info("  %s", statement)
        for warning in checked.warnings:
            warned[warning].append(name)
    for warning, names in warned.items():
        log.warning("%s: %s", listed(names), warning)
    return found


def _compared(recording: CheckedRecording, earlier: list[CheckedRecording]) -> CheckedRecording:
    """A recording, with a warning if it is the same run as an earlier one for training."""
    for other in earlier:
        if other.role == "training" and same_run(other.statistics.rows, recording.statistics.rows):
            copied = (
                f"{recording.name} is the same run as {other.name}, filtered, resampled or rounded: even the "
                "noise of the torques is the same, so nothing was held out; validate with another run"
            )
            return replace(recording, copied=copied, warnings=[*recording.warnings, copied])
    return recording


def check_recording(
    recording: Recording,
    arm: Arm,
    settings: RecordingSettings,
    gains: Sequence[float] | None = None,
    sign_width: float = SIGN_WIDTH,
    known: Delay | None = None,
) -> CheckedRecording:
    """A recording, checked against the arm's description and preprocessed.

    ``known`` is the torque delay determined from several recordings; see ``preprocess`` for the others.
    """
    recording = steadied(recording, arm.velocity_limit)
    statistics = statistics_of(recording, settings)
    if doubt := refused.doubt_of_units(statistics, arm, settings.units):
        if (recording.position % 1).any():  # no counts; rates may be in any unit, too
            plain = replace(recording, velocity=None, acceleration=None)
            rough = preprocess(plain, settings, gains, sign_width, grid_for(statistics, settings, None), 0.0)
            found = agreement_of(RigidBody(arm), rough, settings).positions
            doubt = found.text if found and found.text not in doubt else doubt
        raise RecordingError(f"{recording.name}: {doubt}")
    refused.refuse_idle(statistics, arm)
    refused.refuse_jumps(recording, arm, statistics.gap)
    parts = [recording]
    repeated = None
    if settings.sent is not None:
        sent = load_commanded(Path(settings.sent), arm.joint_names, settings.motion_matrix(arm.joint_names))
        parts, repeated = averaged(recording, sent, statistics.gap)
    grid = grid_for(statistics, settings, None if repeated is None else repeated.bandwidth)

    def kept(delay: float) -> list[Segment]:
        """Segments of all parts with this delay [s] removed."""
        return [x for part in parts for x in preprocess(part, settings, gains, sign_width, grid, delay)]

    body = RigidBody(arm)
    given = settings.delay or 0.0
    segments = kept(given)
    remarks: dict[str, str] = {}
    for rate in [name for name in plausibility.RATES if name in statistics.signals]:
        if wrong := plausibility.contradiction(recording.name, arm, rate, segments):
            none: dict[str, Any] = {rate: None}
            parts = [replace(part, **none) for part in parts]
            used = {name: x for name, x in statistics.signals.items() if name != rate}
            statistics = replace(statistics, signals=used)
            segments = kept(given)
            remarks[rate] = wrong
    left = known or measured(body, segments, lambda delay: kept(given + delay))
    delay = Delay(given, given=True) if given else left
    corrected = settings.delay is None and delay.believed
    segments = kept(delay.seconds) if corrected else segments
    locked = arm.setup.locked or {}
    warnings = [f"{x} is locked and left out, at {locked[x]:.4g}" for x in settings.without if x in locked]
    warnings += [*recording.remarks, *plausibility.clock_warnings(statistics)]
    faults = plausibility.fault_warnings(statistics, arm)
    warnings += [*plausibility.range_warnings(statistics, arm), *faults]
    twice = plausibility.twice_warnings(recording)
    warnings += [*remarks.values(), *twice]
    if gains is not None and recording.load == "torque":
        warnings.append(_UNUSED_GAINS)
    late = None
    if left.noticed and not corrected:
        warnings.append(left.statement(corrected))
        late = warnings[-1] if left.clear or left.lost else None
    # an uncorrected delay would distort the estimated signs and gravity
    timed = kept(given + left.seconds) if late and left.clear else segments
    agreement = agreement_of(body, timed, settings)
    torques = [(x.time, torque_of(x, gains, settings)) for x in parts]
    refused.refuse_overload(statistics, arm, agreement, settings.units, torques)
    return CheckedRecording(
        joint_names=arm.joint_names,
        statistics=statistics,
        grid=grid,
        segments=segments,
        agreement=agreement,
        warnings=warnings + agreement.warnings(arm),
        faults=faults,
        remarks=remarks,
        twice=twice,
        late=late,
        delay=delay,
        corrected=corrected,
        noise=noise_of(torques, grid),
        repeated=repeated,
    )
