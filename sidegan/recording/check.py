"""Check of a recording against the arm's description, and its preprocessing."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from sidegan.base.settings_text import setting_name
from sidegan.errors import RecordingError
from sidegan.motion.dynamics import RigidBody
from sidegan.recording import plausibility, refusals
from sidegan.recording.agreement import agreement_of, to_currents
from sidegan.recording.checked import CheckedRecording
from sidegan.recording.commanded import average_repetitions, load_commanded
from sidegan.recording.delay import Delay, estimate_delay
from sidegan.recording.grid import noise_of
from sidegan.recording.recording import SIGN_WIDTH, Recording, Segment
from sidegan.recording.repairs import remove_glitches
from sidegan.recording.segments import grid_for, preprocess, torque_of
from sidegan.recording.settings import RecordingSettings
from sidegan.recording.statistics import statistics_of
from sidegan.robot import Arm


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
    settings = replace(settings, units=recording.units or settings.units)
    recording = remove_glitches(recording, arm.velocity_limit)
    statistics = statistics_of(recording, settings)
    body = RigidBody(arm)
    if doubt := refusals.doubt_of_units(statistics, arm, settings.units):
        if (recording.position % 1).any():  # no counts: torques may tell the unit
            plain = replace(recording, velocity=None, acceleration=None)  # which may be in any unit, too
            with suppress(RecordingError):  # in the wrong unit, nothing may seem to move
                rough = preprocess(plain, settings, gains, sign_width)
                better = agreement_of(body, rough, settings).positions
                doubt = better.text if better and better.text not in doubt else doubt
        raise RecordingError(f"{recording.name}: {doubt}")
    refusals.refuse_idle(statistics, arm, settings.without)
    refusals.refuse_jumps(recording, arm, statistics.gap)
    parts = [recording]
    repeated = None
    if settings.sent is not None:
        sent = load_commanded(Path(settings.sent), arm.joint_names, settings.motion_matrix(arm.joint_names))
        parts, repeated = average_repetitions(recording, sent, statistics.gap)
    grid = grid_for(statistics, settings, None if repeated is None else repeated.bandwidth)

    def kept(delay: float) -> list[Segment]:
        """Segments of all parts with this delay [s] removed."""
        return [x for part in parts for x in preprocess(part, settings, gains, sign_width, grid, delay)]

    given = settings.delay or 0.0
    segments = kept(given)
    remarks: dict[str, str] = {}
    for rate in [name for name in plausibility.RATES if name in statistics.signals]:
        if wrong := plausibility.contradiction(recording.name, arm, rate, segments):
            remarks[rate] = wrong
            none: dict[str, Any] = {rate: None}
            parts = [replace(part, **none) for part in parts]
            used = {name: x for name, x in statistics.signals.items() if name != rate}
            statistics = replace(statistics, signals=used)
            segments = kept(given)
    left = known or estimate_delay(body, segments, lambda delay: kept(given + delay))
    delay = Delay(given, given=True) if given else left
    corrected = settings.delay is None and delay.believed
    if corrected:
        segments = kept(delay.seconds)
    locked = arm.setup.locked or {}
    faults = plausibility.fault_warnings(statistics, arm)
    twice = plausibility.twice_warnings(recording)
    warnings = [
        *(f"{x} is locked and left out, at {locked[x]:.4g}" for x in settings.without if x in locked),
        *recording.remarks,
        *plausibility.clock_warnings(statistics),
        *plausibility.range_warnings(statistics, arm),
        *faults,
        *remarks.values(),
        *twice,
    ]
    if gains is not None and recording.load == "torque":
        name = setting_name("robot.gains")
        warnings.append(
            f"{name} is not used, since torques were recorded; if they are currents: {to_currents()}"
        )
    late = None
    if left.noticed and not corrected:
        warnings.append(left.statement(corrected))
        late = warnings[-1] if left.clear or left.lost else None
    # an uncorrected delay would distort the estimated signs and gravity
    timed = kept(given + left.seconds) if late and left.clear else segments
    agreement = agreement_of(body, timed, settings)
    torques = [(x.time, torque_of(x, gains, settings)) for x in parts]
    refusals.refuse_overload(statistics, arm, agreement, settings.units, torques)
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
