"""The identification of an arm from recordings: a model with its errors and a verdict, and its files."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array
from sidegan.base.typed import build, settings_of
from sidegan.cell import Cell
from sidegan.errors import ConfigError, ShapeError
from sidegan.identification import EstimationSettings, Terms
from sidegan.identification.identified import IdentifiedArm
from sidegan.identification.workflow import identify_arm
from sidegan.recording.check import CheckedRecording, Role, read_and_check, split
from sidegan.recording.overlap import refuse_shared
from sidegan.recording.settings import Files, Recorded, RecordingSettings
from sidegan.recording.stationary import stationary_positions
from sidegan.report.identification import Origin, write_results
from sidegan.report.identification.content import error_table, link_table, parameter_table
from sidegan.robot import Arm, load_robot, words

# A recording: a file, a table with columns like a file's, or a file for each signal.
Given: TypeAlias = str | Path | pd.DataFrame | Files | Mapping[str, str]
Recordings: TypeAlias = Sequence[Given]


class Checked(NamedTuple):
    """Recordings of an arm, checked and preprocessed."""

    arm: Arm  # the arm as it was recorded
    recordings: list[CheckedRecording]  # as they were read
    training: list[CheckedRecording]  # to identify from, whole or their first parts
    validation: list[CheckedRecording]  # to test with
    origin: Origin  # how they came about


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """A model that was identified from recordings of an arm with J joints, and what is known about it.

    Attributes:
        arm: estimates of every method, their errors, and the recordings.
        origin: command and settings that make the same model.
    """

    arm: IdentifiedArm
    origin: Origin

    @property
    def verdict(self) -> str:
        """``"good"``, ``"usable"`` or ``"not trustworthy"``."""
        return self.arm.quality.verdict

    @property
    def reasons(self) -> list[str]:
        """Reasons of the verdict, a sentence each, the gravest first."""
        return self.arm.quality.reasons

    @property
    def parameters(self) -> pd.DataFrame:
        """A row per identified parameter: name, formula, unit, value, standard deviation, and more."""
        return parameter_table(self.arm)

    @property
    def links(self) -> pd.DataFrame:
        """A row per link of the consistent model: mass [kg], its centre [m], inertia about it [kg·m²]."""
        return link_table(self.arm)

    @property
    def errors(self) -> pd.DataFrame:
        """A row per joint: nMSE and RMSE [N·m or N] of the model to use, in training and in validation."""
        return error_table(self.arm)

    def torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Torque [N·m or N], (…, J), at positions [rad or m], velocities and accelerations, (…, J) each.

        It is that of the model to use, with friction and offsets.

        Raises:
            ShapeError: when the states are not three times (…, J).
        """
        states = [np.asarray(x, float) for x in (q, dq, ddq)]
        joints, shape = self.arm.model.joints, states[0].shape
        if any(x.shape != shape or x.shape[-1:] != (joints,) for x in states):
            shapes = ", ".join(str(x.shape) for x in states)
            raise ShapeError(f"states are {shapes}, expected three times (…, {joints})")
        rows = [x.reshape(-1, joints) for x in states]
        return self.arm.model.torque(self.arm.used.parameters, *rows).reshape(shape)

    def save(self, folder: str | Path) -> None:
        """Write model, URDF, MJCF, a Python class that stands on its own, tables, verdict and report.

        Raises:
            StorageError: when a file cannot be written.
        """
        Path(folder).mkdir(parents=True, exist_ok=True)
        write_results(self.arm, self.origin, Path(folder))


def identify(
    cell: Cell,
    recordings: Recordings,
    validation: Recordings | float = (),
    *,
    recording: RecordingSettings | Mapping[str, Any] | None = None,
    model: Terms | Mapping[str, Any] | None = None,
    estimation: EstimationSettings | Mapping[str, Any] | None = None,
    gains: Sequence[float] | None = None,
) -> IdentifiedModel:
    """The model of an arm from what was recorded, with its errors and a verdict.

    Args:
        cell: the arm in its cell, of which the description counts.
        recordings: to identify from, files (CSV and others) or data frames with such columns; a file for each
            signal is a mapping like ``{"position": "q.csv", "torque": "tau.csv"}``.
        validation: recordings to test with, or the share of each recording that is held out, its last part.
        recording: what the files hold and how they are preprocessed: the fields of ``RecordingSettings``,
            such as ``{"units": {"angle": "deg"}, "sent": "outputs/runs/excite"}``.
        model: terms of the torque beside rigid bodies: the fields of ``Terms``.
        estimation: the method: the fields of ``EstimationSettings``.
        gains: of the drives [N·m/A], (J,), where currents were recorded and no torques.

    Returns:
        The model: ``verdict``, ``parameters``, ``errors``, ``torque(q, dq, ddq)``, ``save(folder)``.

    Raises:
        ConfigError: when a setting is unknown or out of range, or there is no recording.
        RecordingError: when a recording cannot be read or used, or tells too little; names it.
    """
    terms = settings_of(Terms, model)
    checked = check_recordings(
        cell, recordings, validation, recording=recording, gains=gains, sign_width=terms.sign_width
    )
    return identified(cell, checked, terms, settings_of(EstimationSettings, estimation))


def check_recordings(
    cell: Cell,
    recordings: Recordings,
    validation: Recordings | float = (),
    *,
    recording: RecordingSettings | Mapping[str, Any] | None = None,
    gains: Sequence[float] | None = None,
    sign_width: float = Terms.sign_width,
) -> Checked:
    """Recordings of an arm, checked and preprocessed; what is odd about them is logged.

    Args:
        cell: the arm in its cell, of which the description counts.
        recordings: as of ``identify``, like ``validation``, ``recording`` and ``gains``.
        validation: what is held out.
        recording: what the files hold and how they are preprocessed.
        gains: of the drives [N·m/A], (J,).
        sign_width: velocity [rad/s or m/s] at which the smooth sign of Coulomb friction is at 76 %.

    Returns:
        ``training`` and ``validation``, each with ``statistics``, ``segments`` and ``warnings``.

    Raises:
        ConfigError: when a setting is unknown or out of range, or there is no recording.
        RecordingError: when a recording cannot be read or used, or two share samples; names it.
    """
    settings = settings_of(RecordingSettings, recording)
    share = validation if isinstance(validation, float) else None
    tests = () if isinstance(validation, float) else validation
    with TemporaryDirectory() as folder:
        first, held_out = (
            [_named(one, Path(folder, f"{role} {k}.parquet")) for k, one in enumerate(given, 1)]
            for role, given in (("recording", recordings), ("validation", tests))
        )
        if not first:
            raise ConfigError("recordings is empty, expected files or tables of the arm")
        arm = recorded_arm(cell, [*first, *held_out], settings)
        files: list[tuple[Recorded, Role]] = [(one, "training") for one in first]
        files += [(one, "validation") for one in held_out]
        found = read_and_check(files, arm, settings, gains, sign_width)
    refuse_shared([(one.name, one.statistics.rows) for one in found])
    training, validated = found[: len(first)], found[len(first) :]
    if share is not None:
        training, validated = map(list, zip(*(split(one, share) for one in training)))
    commands = _commands(cell, arm, {"recordings": first, "validation": held_out}, share)
    robot = {"name": cell.robot, "gains": gains, **asdict(cell.setup)}
    origin = Origin(*commands, {"robot": robot, "recording": asdict(settings)})
    return Checked(arm, found, training, validated, origin)


def recorded_arm(cell: Cell, recordings: Sequence[Recorded], settings: RecordingSettings) -> Arm:
    """The arm of recordings; joints whose torque they do not have are locked, where they do not move.

    Raises:
        RecordingError: when the arm has no such joint, or one moves.
    """
    if not settings.without:
        return cell.recorded_arm
    locked = {**(cell.setup.locked or {}), **stationary_positions(cell.recorded_arm, recordings, settings)}
    return load_robot(cell.robot, replace(cell.setup, locked=locked), planning=False)


def identified(cell: Cell, checked: Checked, terms: Terms, estimation: EstimationSettings) -> IdentifiedModel:
    """The model of an arm from recordings that were checked; errors as of ``identify``."""
    found = identify_arm(checked.arm, checked.training, checked.validation, terms, estimation)
    settings = {**checked.origin.settings, "model": asdict(terms), "identify": asdict(estimation)}
    return IdentifiedModel(found, checked.origin._replace(settings=settings))


def _named(given: Given, path: Path) -> Recorded:
    """A recording as settings name it; a data frame is written to ``path``, and read as files are."""
    if isinstance(given, pd.DataFrame):
        given.to_parquet(path, index=False)
        return str(path)
    if isinstance(given, Mapping):
        return build(Files, given)
    return given if isinstance(given, Files) else str(given)


def _commands(
    cell: Cell, arm: Arm, lists: Mapping[str, Sequence[Recorded]], share: float | None
) -> tuple[str, str]:
    """The commands that identify an arm from lists of recordings, and that excite what is left uncertain."""
    files = " ".join(f"'{name}=[{','.join(map(str, some))}]'" for name, some in lists.items() if some)
    files += "" if share is None else f" validation={share:g}"
    kept = replace(cell.setup, locked=arm.setup.locked)  # with the joints that stood still
    which, again = (" ".join([f"robot.name={cell.robot}", *words(x)]) for x in (cell.setup, kept))
    run = "python -m sidegan.run +experiment="
    return f"{run}identify {which} {files}", f"{run}excite {again} goal.count=4"
