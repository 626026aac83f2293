"""Recordings that were checked and preprocessed: what is left of them, and what was found."""

import math
from collections import Counter
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.agreement import Agreement
from sidegan.recording.commanded import Repeated
from sidegan.recording.delay import Delay
from sidegan.recording.grid import Grid
from sidegan.recording.recording import Segment
from sidegan.recording.statistics import Statistics

Role = Literal["training", "validation", "loaded"]  # loaded: with a load that the description lacks


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
    late: str | None  # warning about an uncorrected delay that is clear, or longer than is searched
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


def hold_out(recording: CheckedRecording, share: float) -> tuple[CheckedRecording, CheckedRecording]:
    """The first part of a recording, for training, and the last ``share`` of it, for validation.

    Samples between them that the low-pass mixes are left out.
    """
    mixed = round(recording.grid.rate / recording.grid.cutoff)
    end = round((1 - share) * recording.kept)
    first = _part(recording, "training", f"first {1 - share:.0%}", 0, end - mixed)
    last = _part(recording, "validation", f"last {share:.0%}", end, recording.kept)
    if min(first.kept, last.kept) < thresholds.LEAST_HELD_OUT:
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
