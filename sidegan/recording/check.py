"""What a recording is worth, told before anything is fitted."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor

from sidegan.errors import RecordingError
from sidegan.motion.dynamics import RigidBody
from sidegan.recording import plausible, suspicion
from sidegan.recording.conditioning import condition, grid_for
from sidegan.recording.excited import Excited, excited
from sidegan.recording.raw import Survey, reasons, survey
from sidegan.recording.recording import Recording, Segment
from sidegan.recording.settings import Grid, Settings
from sidegan.robot import Arm

_LEAST_NOISE = 1e-6  # of a joint's torque


@dataclass(frozen=True, eq=False)
class Findings:
    """What is known about a recording.

    Attributes:
        survey: of the raw recording.
        grid: what it is conditioned with.
        kept: samples that are left for identification.
        moving: time that they cover [s].
        excited: how well each base parameter is excited.
        sign: correlation of each joint's torque with the description, friction apart, −1 to 1, (J,).
        lag: time by which torques are later than states [s], as far as the motion tells.
        warnings: what a person should look at.
    """

    survey: Survey
    grid: Grid
    kept: int
    moving: float
    excited: Excited
    sign: Tensor
    lag: float
    warnings: list[str]

    @property
    def derived(self) -> list[str]:
        """Signals that were not recorded, and are derivatives of others."""
        return [name for name in ("velocity", "acceleration") if name not in self.survey.signals]

    def plain(self) -> dict[str, Any]:
        """All of it as JSON takes it."""
        known = self.survey
        signals = {
            name: {key: x.tolist() for key, x in vars(signal).items()}
            for name, signal in known.signals.items()
        }
        told = excited_rows(self.excited)
        return {
            "name": known.name,
            "samples": known.samples,
            "duration": known.duration,
            "rate": 1 / known.step,
            "jitter": known.jitter,
            "duplicates": known.duplicates,
            "gaps": [list(gap) for gap in known.gaps],
            "corrupt": {"count": len(known.corrupt), "reasons": reasons(known.corrupt)},
            "corrupt_rows": [list(row) for row in known.corrupt[:100]],
            "signals": signals,
            "derived": self.derived,
            "conditioning": {**asdict(self.grid), "statement": self.grid.statement},
            "kept": self.kept,
            "moving": self.moving,
            "sign": self.sign.tolist(),
            "lag": self.lag,
            "condition": self.excited.condition,
            "excited": told,
            "weak": self.excited.weak,
            "warnings": self.warnings,
        }


def check_recording(
    recording: Recording | Iterable[Recording], arm: Arm, settings: Settings | None = None, angle: str = "rad"
) -> Findings:
    """What a recording is worth; nothing is fitted to it. Arguments and errors are those of ``examine``."""
    return examine(recording, arm, settings, angle)[0]


def examine(
    recording: Recording | Iterable[Recording], arm: Arm, settings: Settings | None = None, angle: str = "rad"
) -> tuple[Findings, list[Segment]]:
    """What a recording is worth, and its conditioned segments.

    Args:
        recording: whole, or its pieces; they are walked through twice.
        arm: whose description the torques are compared with.
        settings: of the conditioning.
        angle: unit that the file's angles were declared in.

    Raises:
        RecordingError: when the recording cannot be used: time runs backwards, nothing moves, torques are
            zero or constant, positions are in another unit than declared.
    """
    settings = settings or Settings()
    known = survey(recording, settings.gap)
    if known.signals["position"].lower.shape != (arm.joints,):
        raise RecordingError(
            f"{known.name} has {len(known.signals['position'].lower)} joints, {arm.name} has {arm.joints}"
        )
    plausible.refuse_wrong_units(known, arm, angle)
    plausible.refuse_idle(known)
    grid = grid_for(known, settings)
    segments = condition(recording, settings, grid)
    body = RigidBody(arm)
    warnings = plausible.clock_warnings(known) + plausible.range_warnings(known, arm)
    warnings += suspicion.velocity_mismatch(known, arm, segments)
    correlation, friction = suspicion.signs(body, segments)
    late, believed = suspicion.lag(body, segments)
    warnings += _model_warnings(arm, correlation, friction, late if believed else 0.0)
    told = excited(body, segments, _torque_noise(known, segments, settings))
    if told.weak:
        warnings.append(
            f"{len(told.weak)} of {len(told.names)} base parameters are hardly excited (condition number "
            f"{told.condition:.3g}): {', '.join(told.weak)}"
        )
    kept = sum(len(segment.time) for segment in segments)
    moving = sum(float(segment.time[-1] - segment.time[0]) for segment in segments)
    return Findings(known, grid, kept, moving, told, correlation, late, warnings), segments


def excited_rows(told: Excited) -> list[dict[str, Any]]:
    """A row per base parameter."""
    columns = (told.contribution.tolist(), told.alone.tolist(), told.deviation.tolist())
    keys = ("contribution", "alone", "deviation")
    return [{"name": name, **dict(zip(keys, row))} for name, *row in zip(told.names, *columns)]


def _model_warnings(arm: Arm, correlation: Tensor, friction: Tensor, late: float) -> list[str]:
    wrong, unknown = suspicion.suspicious(arm, correlation, friction)
    found = []
    if wrong:
        found.append(
            f"the torque of {', '.join(wrong)} runs against the description: is its sign wrong? "
            f"(recording.reverse=[{','.join(wrong)}])"
        )
    if unknown:
        found.append(
            f"the motion does not tell whether the sign of the torque of {', '.join(unknown)} is right"
        )
    if late:
        found.append(
            f"torques look {abs(late) * 1e3:.0f} ms {'later' if late > 0 else 'earlier'} than the states"
        )
    return found


def _torque_noise(known: Survey, segments: list[Segment], settings: Settings) -> Tensor:
    """Noise floor of each joint's torque [N·m or N], (J,)."""
    if "torque" in known.signals:
        noise = known.signals["torque"].noise
    else:
        noise = known.signals["current"].noise * torch.tensor(settings.gains, dtype=torch.float64)
    size = torch.cat([segment.torque for segment in segments]).square().mean(0).sqrt()
    return torch.maximum(noise, _LEAST_NOISE * size.max())
