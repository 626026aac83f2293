"""Identify an arm from recordings: a model with its errors, a verdict, and result files."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from numbers import Real
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array
from sidegan.base.storage import path_of, writing
from sidegan.base.typed import build, settings_of
from sidegan.cell import Cell, require_cell
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.identification import EstimationSettings, Terms
from sidegan.identification.identified import IdentifiedArm
from sidegan.identification.workflow import identify_arm
from sidegan.recording.checked import CheckedRecording, Role, hold_out
from sidegan.recording.column_names import stamps_of
from sidegan.recording.overlap import refuse_shared
from sidegan.recording.read import read_and_check
from sidegan.recording.settings import Files, Recorded, RecordingSettings
from sidegan.recording.stationary import refuse_elsewhere, stationary_positions
from sidegan.report.identification import Origin, write_results
from sidegan.report.identification.content import error_table, headline, link_table, parameter_table
from sidegan.robot import Arm, changes, robot_settings, setting

# A recording: a file, a table with the same columns, or one of them for each signal.
Given: TypeAlias = str | Path | pd.DataFrame | Files | Mapping[str, str | pd.DataFrame]
Recordings: TypeAlias = Sequence[Given]


class Checked(NamedTuple):
    """Recordings of an arm, checked and preprocessed."""

    arm: Arm  # as recorded, with locked joints
    recordings: list[CheckedRecording]  # in the order given
    training: list[CheckedRecording]  # to identify from: whole recordings, or their first parts
    validation: list[CheckedRecording]  # to test with
    origin: Origin  # command and settings


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """A model identified from recordings of an arm with J joints, its errors and verdict.

    Attributes:
        arm: estimates of every method, their errors, and the recordings.
        origin: command and settings that reproduce the model.
    """

    arm: IdentifiedArm
    origin: Origin

    def __repr__(self) -> str:
        return f"IdentifiedModel({self.arm.model.arm.name}: {headline(self.arm)})"

    @property
    def verdict(self) -> str:
        """``"good"``, ``"usable"`` or ``"not trustworthy"``."""
        return self.arm.quality.verdict

    @property
    def reasons(self) -> list[str]:
        """Reasons for the verdict, a sentence each, most severe first."""
        return self.arm.quality.reasons

    @property
    def parameters(self) -> pd.DataFrame:
        """A row per identified parameter: name, formula, unit, value, standard deviation, and more."""
        return parameter_table(self.arm)

    @property
    def links(self) -> pd.DataFrame:
        """A row per link of the consistent model: mass [kg], centre of mass [m], inertia about it [kg·m²]."""
        return link_table(self.arm)

    @property
    def errors(self) -> pd.DataFrame:
        """A row per joint: nMSE and RMSE [N·m or N] of the recommended model in training and validation."""
        return error_table(self.arm)

    def torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Torque [N·m or N], (…, J), at positions [rad or m], velocities and accelerations, (…, J) each.

        The recommended model computes it, including friction and offsets.

        Raises:
            ShapeError: when the states do not have equal shapes (…, J).
        """
        model = self.arm.model
        states = model.body.checked(q, dq, ddq)
        rows = [x.reshape(-1, model.joints) for x in states]
        return model.torque(self.arm.used.parameters, *rows).reshape(states[0].shape)

    def save(self, folder: str | Path) -> None:
        """Write model, URDF, MJCF, a standalone Python class, a C header, tables, verdict and report.

        Raises:
            StorageError: when a file cannot be written.
        """
        path = path_of(folder, "folder")
        with writing(path):
            path.mkdir(parents=True, exist_ok=True)
        write_results(self.arm, self.origin, path)


def identify(
    cell: Cell,
    recordings: Recordings | Given,
    validation: Recordings | Given | float = (),
    *,
    recording: RecordingSettings | Mapping[str, Any] | None = None,
    model: Terms | Mapping[str, Any] | None = None,
    estimation: EstimationSettings | Mapping[str, Any] | None = None,
    gains: Sequence[float] | None = None,
) -> IdentifiedModel:
    """Identify an arm's model from recordings, with its errors and a verdict.

    Args:
        cell: the arm in its cell; only its description is used.
        recordings: one or more to identify from: a file (CSV and others), a data frame with the same columns,
            or a mapping with one of them per signal, such as ``{"position": "q.csv", "torque": "tau.csv"}``.
            The index of a data frame, if it has a name or holds times, is read unless a column has the time.
        validation: recordings to test with, or the share of each recording, at its end, to hold out.
        recording: contents of the files and their preprocessing: the fields of ``RecordingSettings``, such as
            ``{"units": {"angle": "deg"}, "sent": "outputs/runs/excite", "delay": None}`` (None: measured).
        model: torque terms in addition to rigid bodies: the fields of ``Terms``.
        estimation: the method: the fields of ``EstimationSettings``.
        gains: drive gains [N·m/A], (J,), if currents were recorded instead of torques.

    Returns:
        The model: ``verdict``, ``parameters``, ``errors``, ``torque(q, dq, ddq)``, ``save(folder)``.

    Raises:
        ConfigError: when a setting is unknown or out of range, or there is no recording.
        RecordingError: when a recording cannot be read or used, or has too few samples; names it.
    """
    terms = settings_of(Terms, model)
    checked = check_recordings(
        cell, recordings, validation, recording=recording, gains=gains, sign_width=terms.sign_width
    )
    return identified(cell, checked, terms, settings_of(EstimationSettings, estimation))


def check_recordings(
    cell: Cell,
    recordings: Recordings | Given,
    validation: Recordings | Given | float = (),
    *,
    recording: RecordingSettings | Mapping[str, Any] | None = None,
    gains: Sequence[float] | None = None,
    sign_width: float = Terms.sign_width,
) -> Checked:
    """Check and preprocess recordings of an arm; logs warnings about them.

    Arguments are those of ``identify``, and ``sign_width``, the velocity [rad/s or m/s] at which the smooth
    sign of Coulomb friction reaches 76 %.

    Returns:
        ``training`` and ``validation``, each with ``statistics``, ``segments`` and ``warnings``.

    Raises:
        ConfigError: when a setting is unknown or out of range, or there is no recording.
        RecordingError: when a recording cannot be read or used, or two share samples; names it.
    """
    require_cell(cell)
    settings = settings_of(RecordingSettings, recording)
    sign_width = build(Terms, {"sign_width": sign_width}).sign_width
    share = _share(validation)
    gains = _gains(gains)
    with TemporaryDirectory() as folder:
        first = _named(recordings, "recording", folder)
        held_out = [] if share else _named(validation, "validation", folder)
        if not first:
            raise ConfigError("recordings is empty, expected files or tables of the arm")
        arm = recorded_arm(cell, [*first, *held_out], settings)
        training, validated = read_groups(
            arm, first, held_out, "validation", settings, gains, sign_width, f"{folder}/"
        )
    found = [*training, *validated]
    if share is not None:
        parts = [hold_out(checked, share) for checked in training]
        training, validated = [head for head, _ in parts], [tail for _, tail in parts]
    given = {"recordings": first, "validation": held_out or share, "robot.gains": gains}
    command, excite = _commands(cell, arm, given, settings)
    command = command.replace(f"{folder}/", "")  # data frames are shown by their names
    robot = {"name": cell.robot, "gains": gains, **asdict(cell.setup)}
    origin = Origin(command, excite, {"robot": robot, "recording": asdict(settings)})
    return Checked(arm, found, training, validated, origin)


def read_groups(
    arm: Arm,
    training: Sequence[Recorded],
    others: Sequence[Recorded],
    role: Role,
    settings: RecordingSettings,
    gains: Sequence[float] | None,
    sign_width: float,
    folder: str = "",
) -> tuple[list[CheckedRecording], list[CheckedRecording]]:
    """Recordings for training, and others in a role of their own, checked and preprocessed.

    Raises:
        RecordingError: when a recording cannot be read or used, or two share samples; names it.
    """
    refuse_elsewhere(arm, [*training, *others], settings)
    files: list[tuple[Recorded, Role]] = [(file, "training") for file in training]
    files += [(file, role) for file in others]
    found = read_and_check(files, arm, settings, gains, sign_width, folder)
    refuse_shared([(checked.name, checked.statistics.rows) for checked in found])
    return found[: len(training)], found[len(training) :]


def recorded_arm(cell: Cell, recordings: Sequence[Recorded], settings: RecordingSettings) -> Arm:
    """The recorded arm; joints without recorded torque are locked where they stand.

    Raises:
        RecordingError: when the arm has no such joint, or it moves.
    """
    if not settings.without:
        return cell.recorded_arm
    return cell.recorded_with(stationary_positions(cell.recorded_arm, recordings, settings))


def identified(cell: Cell, checked: Checked, terms: Terms, estimation: EstimationSettings) -> IdentifiedModel:
    """Identify an arm from checked recordings; raises the errors of ``identify``."""
    try:
        found = identify_arm(checked.arm, checked.training, checked.validation, terms, estimation)
    except InfeasibleError as error:  # the recordings' faults may be why
        known = dict.fromkeys(text for recording in checked.recordings for text in recording.warnings)
        raise InfeasibleError("; ".join([str(error), *known])) from error
    settings = {**checked.origin.settings, "model": asdict(terms), "identify": asdict(estimation)}
    command = " ".join([checked.origin.command, *changes("model", terms), *changes("identify", estimation)])
    return IdentifiedModel(found, checked.origin._replace(command=command, settings=settings))


def _gains(given: Sequence[float] | None) -> list[float] | None:
    """Drive gains [N·m/A] as plain numbers; a ConfigError unless they are finite and not zero."""
    if given is None:
        return None
    with suppress(TypeError, ValueError):  # of what are no numbers
        gains = np.asarray(given, float)
        if gains.ndim == 1 and (np.isfinite(gains) & (gains != 0)).all():
            return gains.tolist()
    raise ConfigError(f"gains is {given!r}, expected a drive gain of each joint, not zero [N·m/A]")


def _share(validation: Recordings | Given | float) -> float | None:
    """The share of the recordings to hold out; None if validation is recordings."""
    if not isinstance(validation, Real):
        return None
    if isinstance(validation, bool) or not 0 < validation < 1:
        raise ConfigError(f"validation is {validation!r}, expected recordings or a share between 0 and 1")
    return float(validation)


def _named(given: object, role: str, folder: str) -> list[Recorded]:
    """Recordings, one or several, as in the settings; data frames are stored in a folder by their names."""
    if given is None:
        return []
    one = isinstance(given, str | Path | pd.DataFrame | Files | Mapping)
    each = [given] if one or not isinstance(given, Iterable) else given
    return [_recording(x, Path(folder, f"{role} {k}")) for k, x in enumerate(each, 1)]


def _recording(given: object, path: Path) -> Recorded:
    """A recording as in the settings; a data frame is written to ``path`` first, with its name there."""
    match given:
        case pd.DataFrame():
            return _stored(given, path)
        case Files():
            return given
        case str() | Path():
            if not str(given):
                raise ConfigError(f"{path.name} is empty text, expected the path of a file")
            return str(given)
        case Mapping():
            frames = {signal: x for signal, x in given.items() if isinstance(x, pd.DataFrame)}
            files = build(Files, {**given, **{signal: f"{path.name} {signal}" for signal in frames}})
            paths = {signal: path.with_name(getattr(files, signal)) for signal in frames}
            return replace(files, **{signal: _stored(x, paths[signal]) for signal, x in frames.items()})
    kind = type(given).__name__
    raise ConfigError(f"{path.name} is of type {kind}, expected a file, a data frame, or one for each signal")


def _stored(frame: pd.DataFrame, path: Path) -> str:
    """Path of a data frame, written with its index as a column if that may hold the time."""
    if frame.empty:
        raise ConfigError(f"{path.name} is an empty data frame")
    timed = isinstance(frame.index, pd.DatetimeIndex | pd.TimedeltaIndex)
    name = frame.index.name if isinstance(frame.index.name, str) else "time" if timed else ""
    try:
        if name and not stamps_of([*map(str, frame)]):
            frame = frame.reset_index(names=name)
        frame.to_parquet(path, index=False)
    except (ValueError, TypeError, NotImplementedError) as error:  # of pyarrow
        raise ConfigError(f"{path.name} is a data frame that cannot be stored: {error}") from error
    return str(path)


def _commands(
    cell: Cell, arm: Arm, given: Mapping[str, Any], recording: RecordingSettings
) -> tuple[str, str]:
    """The commands that identify an arm from what is given, and that then excite uncertain parameters."""
    run = "python -m sidegan.run +experiment="
    words = [robot_settings(cell.robot, cell.setup), *(setting(name, x) for name, x in given.items() if x)]
    identify = " ".join([f"{run}identify", *words, *changes("recording", recording)])
    locked = replace(cell.setup, locked=arm.setup.locked)  # including joints that stood still
    excite = f"{run}excite {robot_settings(cell.robot, locked)} goal.count=4"
    if recording.coupling:
        excite += f" {setting('controllers.coupling', recording.coupling)}"
    return identify, excite
