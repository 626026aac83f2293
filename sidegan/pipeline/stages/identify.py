"""Stages check and identify: recordings of a real arm, and its model."""

import hashlib
import logging
import shutil
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from sidegan.base.storage import file_digest, read_json, reading, replacing
from sidegan.errors import ConfigError, RecordingError
from sidegan.identification.residuals import BIASED
from sidegan.pipeline.artifact import Artifact, Build, Metrics
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.store import PARAMS
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.commanded import commanded_files
from sidegan.recording.load import files_of
from sidegan.recording.settings import Files, Recorded
from sidegan.report.export import show
from sidegan.report.identification import REPORT, VERDICT, check_table, write_checks
from sidegan.robot import Arm, describe_doubtful_links
from sidegan.steps import identify as steps

_log = logging.getLogger(__name__)


def model(run: RunContext) -> Artifact:
    """The model identified from the configured recordings."""
    cfg = run.cfg
    arm = configured_arm(run)
    files = _files("recordings", cfg.recordings) | _files("validation", cfg.held_out)
    inputs = {"robot": arm.digest, "urdf": _digest(arm.urdf)}
    sent = [] if cfg.recording.sent is None else commanded_files(Path(cfg.recording.sent))
    read = files | {f"sent.{path.stem}": path for path in sent}
    inputs |= {key: _digest(path) for key, path in read.items()}
    settings: dict[str, object] = {n: asdict(getattr(cfg, n)) for n in ("recording", "model", "identify")}
    settings |= {} if isinstance(cfg.validation, list) else {"held_out": cfg.validation}
    settings |= {"gains": cfg.robot.gains, "names": {key: path.name for key, path in files.items()}}
    return Artifact(
        maker="identify",
        label=f"{arm.name}-{cfg.identify.method}",
        title="identify",
        settings=settings,
        inputs=inputs,
        seed=None,
        make=partial(_make, run),
        metrics=_error,
        alone=True,
    )


def _files(name: str, recordings: Sequence[Recorded]) -> dict[str, Path]:
    """All files of recordings, by recording and signal."""
    found: dict[str, Path] = {}
    for i, recording in enumerate(recordings):
        files = vars(recording) if isinstance(recording, Files) else {"": recording}
        found |= {f"{name}.{i}.{key}".rstrip("."): Path(path) for key, path in files.items() if path}
    return found


def _digest(path: Path) -> str:
    """Hexadecimal SHA-256 of a file, or of all files of a folder, a bag or a dataset."""
    digest = hashlib.sha256()
    with reading(path, "recording", RecordingError):
        for file in files_of(path):
            digest.update(file.name.encode())
            digest.update(bytes.fromhex(file_digest(file)))
    return digest.hexdigest()


def configured_arm(run: RunContext) -> Arm:
    """The recorded arm; joints that stand still and have no recorded torque are locked."""
    cfg = run.cfg
    if not cfg.robot.name:
        raise ConfigError("which arm was recorded? robot.name=/path/to/arm.urdf, or robot=kuka_lwr4")
    if not cfg.recordings:
        raise ConfigError("recordings is empty, expected files of the arm: 'recordings=[a.csv,b.csv]'")
    loaded = cfg.loaded if cfg.has("loaded") else []
    return steps.recorded_arm(run.cell, [*cfg.recordings, *cfg.held_out, *loaded], cfg.recording)


def _checked(run: RunContext) -> steps.Checked:
    """The configured recordings, checked and preprocessed; prints the check."""
    cfg = run.cfg
    found = steps.check_recordings(
        run.cell,
        cfg.recordings,
        cfg.validation,
        recording=cfg.recording,
        gains=cfg.robot.gains,
        sign_width=cfg.model.sign_width,
    )
    show(check_table(found.recordings), "Joints [rad, m, N·m, N, A]")
    return found


def _make(run: RunContext, build: Build) -> None:
    steps.identified(run.cell, _checked(run), run.cfg.model, run.cfg.identify).save(build.folder)


def _error(folder: Path) -> Metrics:
    return {"nmse": read_json(folder / VERDICT)["validation"]["nmse_mean"]}


def _show(run: RunContext, tracker: Tracker) -> None:
    """Copy all results to the run's folder, and log a summary."""
    folder = run.store.require(model(run))
    target = run.store.run_folder
    for path in sorted(folder.iterdir()):
        if path.name != PARAMS:
            with replacing(target / path.name) as temporary:
                shutil.copyfile(path, temporary)
            tracker.log_artifact(path, "identify")
    verdict = read_json(folder / VERDICT)
    error, kind = verdict["validation"]["nmse_mean"], verdict["validation"]["kind"]
    _log.info("%s, %s: mean nMSE %.4g (%s)", verdict["robot"], verdict["verdict"], error, kind)
    biased = [line for line in verdict["left_over"] if line.endswith(BIASED)]
    for line in (verdict["advice"], *verdict["reasons"], *verdict["modelled"], *biased):
        _log.info("  %s", line)
    errors = [f"{name} {errors['nmse_mean']:.4g}" for name, errors in verdict["files"].items()]
    _log.info("  mean nMSE of each file, read again: %s", ", ".join(errors))
    _log.info("report: %s", target / REPORT)


def _show_check(run: RunContext, tracker: Tracker) -> None:
    """Read and check the configured recordings, and write the check to the run's folder."""
    found = _checked(run)
    path = write_checks([*found.training, *found.validation], run.store.run_folder)
    tracker.log_artifact(path, "identify")


def _warn_doubtful_links(run: RunContext) -> None:
    if doubtful := describe_doubtful_links(configured_arm(run)):
        _log.warning("%s; identification starts from the nearest possible ones", doubtful)


STAGES = {
    "check": Stage(show=_show_check, check=configured_arm),
    "identify": Stage(lambda run: [model(run)], _show, _warn_doubtful_links),
}
