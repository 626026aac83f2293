"""Recordings of one arm, read from files and checked together."""

import logging
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from sidegan.base.names import listed
from sidegan.recording.check import check_recording
from sidegan.recording.checked import CheckedRecording, Role
from sidegan.recording.delay import Delay, pool_delays
from sidegan.recording.load import recording_name
from sidegan.recording.overlap import same_run
from sidegan.recording.recording import SIGN_WIDTH
from sidegan.recording.settings import Files, Recorded, RecordingSettings
from sidegan.recording.stationary import load_for
from sidegan.robot import Arm

_log = logging.getLogger(__name__)


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
    common = pool_delays([checked.delay for checked in found])
    if common is not None and settings.delay is None:
        found = [check_recording(x, arm, settings, gains, sign_width, common) for x in read]
    elif common is not None:
        found = [_with_delay(checked, common) for checked in found]
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
        _log.info("%s: %d samples in %.4g s, %s", name, raw.samples, raw.duration, role)
        for statement in checked.statements:
            _log.info("  %s", statement)
        for warning in checked.warnings:
            warned[warning].append(name)
    for warning, names in warned.items():
        _log.warning("%s: %s", listed(names), warning)
    return found


def _with_delay(recording: CheckedRecording, delay: Delay) -> CheckedRecording:
    """A recording with the delay of all in place of its own, also in the warning about it."""
    own, said = (x.statement(recording.corrected) for x in (recording.delay, delay))
    warnings = [said if warning == own else warning for warning in recording.warnings]
    late = said if recording.late == own else recording.late
    return replace(recording, delay=delay, warnings=warnings, late=late)


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
