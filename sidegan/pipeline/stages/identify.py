"""Stages identify and check: recordings of a real arm to a consistent model of it; what they are worth."""

import hashlib
import logging
import shutil
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from sidegan.base.storage import file_digest, read_json, reading, replacing
from sidegan.errors import ConfigError, RecordingError
from sidegan.identification.lacking import BIASED
from sidegan.identification.workflow import identify_arm
from sidegan.pipeline.artifact import Artifact, Build, Metrics
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.settings import Config
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.store import PARAMS
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.check import CheckedRecording, Role, read_and_check, split
from sidegan.recording.load import files_of
from sidegan.recording.overlap import refuse_shared
from sidegan.recording.sent import sent_files
from sidegan.recording.settings import Files, Recorded
from sidegan.recording.standing import standing
from sidegan.report.identification import REPORT, VERDICT, Origin, show_checks, write_checks, write_results
from sidegan.robot import Arm, load_robot, tell_doubtful, words

log = logging.getLogger(__name__)


def model(run: RunContext) -> Artifact:
    """The model identified from the configured recordings."""
    cfg = run.cfg
    arm = recorded_arm(run)
    files = _files("recordings", cfg.recordings) | _files("validation", cfg.held_out)
    inputs = {"robot": arm.digest, "urdf": _digest(arm.urdf)}
    sent = [] if cfg.recording.sent is None else sent_files(Path(cfg.recording.sent))
    read = files | {f"sent.{one.stem}": one for one in sent}
    inputs |= {key: _digest(path) for key, path in read.items()}
    settings: dict[str, object] = {n: asdict(getattr(cfg, n)) for n in ("recording", "model", "identify")}
    settings |= {} if isinstance(cfg.validation, list) else {"held_out": cfg.validation}
    settings |= {"gains": cfg.robot.gains, "names": {key: path.name for key, path in files.items()}}
    label, make = f"{arm.name}-{cfg.identify.method}", partial(_make, cfg, arm)
    return Artifact("identify", label, "identify", settings, inputs, None, make, _error, alone=True)


def _files(name: str, recordings: Sequence[Recorded]) -> dict[str, Path]:
    """All files of recordings by which of their recording they are."""
    found: dict[str, Path] = {}
    for i, one in enumerate(recordings):
        each = vars(one) if isinstance(one, Files) else {"": one}
        found |= {f"{name}.{i}.{key}".rstrip("."): Path(path) for key, path in each.items() if path}
    return found


def recorded_arm(run: RunContext) -> Arm:
    """The arm of the recordings; joints whose torque they do not have are locked, where they do not move."""
    cfg = run.cfg
    if not cfg.robot.name:
        raise ConfigError("which arm was recorded? robot.name=/path/to/arm.urdf, or robot=kuka_lwr4")
    if not cfg.recordings:
        raise ConfigError("recordings is empty, expected files of the arm: 'recordings=[a.csv,b.csv]'")
    arm = run.cell.recorded_arm
    if not cfg.recording.without:
        return arm
    loaded = cfg.loaded if cfg.has("loaded") else []
    places = standing(arm, [*cfg.recordings, *cfg.held_out, *loaded], cfg.recording)
    locked = {**(arm.setup.locked or {}), **places}
    return load_robot(cfg.robot.name, replace(cfg.robot.setup, locked=locked), planning=run.planning)


def checked(cfg: Config, arm: Arm) -> tuple[list[CheckedRecording], list[CheckedRecording]]:
    """Recordings to identify from and to validate on, checked and preprocessed; the check is printed."""
    files: list[tuple[Recorded, Role]] = [(one, "training") for one in cfg.recordings]
    files += [(one, "validation") for one in cfg.held_out]
    recordings = read_and_check(files, arm, cfg.recording, cfg.robot.gains, cfg.model.sign_width)
    refuse_shared([(one.name, one.statistics.rows) for one in recordings])
    show_checks(recordings)
    training, validation = recordings[: len(cfg.recordings)], recordings[len(cfg.recordings) :]
    if isinstance(cfg.validation, list):
        return training, validation
    parts = [split(one, cfg.validation) for one in training]
    return [first for first, _ in parts], [last for _, last in parts]


def _make(cfg: Config, arm: Arm, build: Build) -> None:
    training, validation = checked(cfg, arm)
    identified = identify_arm(arm, training, validation, cfg.model, cfg.identify)
    groups = {name: asdict(getattr(cfg, name)) for name in ("robot", "recording", "model", "identify")}
    write_results(identified, Origin(_command(cfg), _excite(cfg, arm), groups), build.folder)


def _command(cfg: Config) -> str:
    lists = {"recordings": cfg.recordings, "validation": cfg.held_out}
    files = " ".join(f"'{name}=[{','.join(map(str, some))}]'" for name, some in lists.items() if some)
    if not isinstance(cfg.validation, list):
        files += f" validation={cfg.validation:g}"
    arm = " ".join([f"robot.name={cfg.robot.name}", *words(cfg.robot.setup)])
    return f"python -m sidegan.run +experiment=identify {arm} {files}"


def _excite(cfg: Config, arm: Arm) -> str:
    """The command that designs trajectories for what is left uncertain, but for the run's folder."""
    setup = replace(cfg.robot.setup, locked=arm.setup.locked)
    which = " ".join([f"robot.name={cfg.robot.name}", *words(setup)])
    return f"python -m sidegan.run +experiment=excite {which} goal.count=4"


def _error(folder: Path) -> Metrics:
    return {"nmse": read_json(folder / VERDICT)["validation"]["nmse_mean"]}


def _show(run: RunContext, tracker: Tracker) -> None:
    """Leave all results in the run's folder, and sum up for people."""
    folder, target = run.store.require(model(run)), run.store.run_folder
    for path in sorted(folder.iterdir()):
        if path.name != PARAMS:
            with replacing(target / path.name) as neighbour:
                shutil.copyfile(path, neighbour)
            tracker.log_artifact(path, "identify")
    verdict = read_json(folder / VERDICT)
    error, kind = verdict["validation"]["nmse_mean"], verdict["validation"]["kind"]
    log.info("%s, %s: mean nMSE %.4g (%s)", verdict["robot"], verdict["verdict"], error, kind)
    biased = [line for line in verdict["left_over"] if line.endswith(BIASED)]
    for line in (verdict["advice"], *verdict["reasons"], *biased):
        log.info("  %s", line)
    log.info("report: %s", target / REPORT)


def _digest(path: Path) -> str:
    """Hexadecimal SHA-256 of a file, or of all files of a folder, a bag or a dataset."""
    digest = hashlib.sha256()
    with reading(path, "recording", RecordingError):
        for one in files_of(path):
            digest.update(one.name.encode())
            digest.update(bytes.fromhex(file_digest(one)))
    return digest.hexdigest()


def _show_check(run: RunContext, tracker: Tracker) -> None:
    """Read and check the configured recordings, and leave what the check says in the run's folder."""
    training, validation = checked(run.cfg, recorded_arm(run))
    path = write_checks([*training, *validation], run.store.run_folder)
    tracker.log_artifact(path, "identify")


def _tell_doubtful(run: RunContext) -> None:
    if doubtful := tell_doubtful(recorded_arm(run)):
        log.warning("%s; identification starts from the nearest that can be", doubtful)


STAGES = {
    "check": Stage(show=_show_check, check=recorded_arm),
    "identify": Stage(lambda run: [model(run)], _show, _tell_doubtful),
}
