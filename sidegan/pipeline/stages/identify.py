"""Stages that read recordings of a real arm: check, identify, payload and gains."""

import hashlib
import logging
import shutil
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from sidegan.base.storage import file_digest, read_json, reading, replacing, write_json
from sidegan.errors import ConfigError, RecordingError
from sidegan.identification.identified import measurements_of
from sidegan.identification.model import TorqueModel
from sidegan.identification.payload import VALUES, drive_gains, identify_payload
from sidegan.identification.residuals import BIASED
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.artifact import Artifact, Build, Metrics
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.store import PARAMS
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.checked import CheckedRecording, Role
from sidegan.recording.commanded import commanded_files
from sidegan.recording.load import files_of
from sidegan.recording.overlap import refuse_shared
from sidegan.recording.read import read_and_check
from sidegan.recording.settings import Files, Recorded, RecordingSettings
from sidegan.report.export import publish, show
from sidegan.report.identification import REPORT, VERDICT, check_table, write_checks
from sidegan.robot import Arm, describe_doubtful_links
from sidegan.steps import identify as steps

_UNITS = ["kg", *["m"] * 3, *["kg·m²"] * 6]  # of a load's values
_log = logging.getLogger(__name__)


def model(run: RunContext) -> Artifact:
    """The model identified from the configured recordings."""
    cfg = run.cfg
    arm = _recorded_arm(run)
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


def _recorded_arm(run: RunContext) -> Arm:
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


def _both(
    run: RunContext, arm: Arm, recording: RecordingSettings, gains: list[float] | None
) -> list[list[CheckedRecording]]:
    """Recordings without and with the load, checked and preprocessed; a ConfigError if none have it."""
    cfg = run.cfg
    if not cfg.loaded:
        raise ConfigError("loaded is empty, expected recordings with the load: 'loaded=[a.csv]'")
    files: list[tuple[Recorded, Role]] = [(file, "training") for file in cfg.recordings]
    files += [(file, "loaded") for file in cfg.loaded]
    found = read_and_check(files, arm, recording, gains, cfg.model.sign_width)
    refuse_shared([(recording.name, recording.statistics.rows) for recording in found])
    return [found[: len(cfg.recordings)], found[len(cfg.recordings) :]]


def _show_payload(run: RunContext, tracker: Tracker) -> None:
    """Identify the load, and write it to the run's folder: SI units, inertia about the centre of mass."""
    cfg, folder = run.cfg, run.store.run_folder
    arm = _recorded_arm(run)
    unloaded, loaded = map(measurements_of, _both(run, arm, cfg.recording, cfg.robot.gains))
    found = identify_payload(TorqueModel(RigidBody(arm), cfg.model), unloaded, loaded)
    values, deviation = found.values.tolist(), found.deviation.tolist()
    content = {"link": found.link, "certain": found.certain, **dict(zip(VALUES, values))}
    content |= {"deviation": dict(zip(VALUES, deviation)), "inertial_parameters": found.body.tolist()}
    content |= {"least_squares": found.estimate.tolist(), "covariance": found.covariance.tolist()}
    content["nmse"] = {"without": found.without.tolist(), "with": found.explained.tolist()}
    write_json(folder / "payload.json", content)
    shown = {name: [f"{x:.4g}" for x in column] for name, column in (("value", values), ("σ", deviation))}
    table = pd.DataFrame({**shown, "unit": _UNITS}, index=pd.Index(VALUES, name="load"))
    caption = (
        f"Load of {arm.name}, in the frame of {found.link}, inertia about the centre of mass; mean nMSE of "
        f"the loaded runs: {found.without.mean():.3g} modelled without a load, {found.explained.mean():.3g} "
        f"with this one"
    )
    publish(table, folder / "payload", caption, tracker)
    place = ", ".join(f"{x:.4f} ± {s:.1g}" for x, s in zip(values[1:4], deviation[1:4]))
    words = (
        f"{values[0]:.3f} ± {deviation[0]:.1g} kg, centre of mass ({place}) m in the frame of {found.link}"
    )
    none = f"none that can be detected ({values[0]:.2g} ± {deviation[0]:.1g} kg)"
    _log.info("load: %s", words if found.certain else none)


def _show_gains(run: RunContext, tracker: Tracker) -> None:
    """Identify the gains, and write them to the run's folder; log them as a setting if all are certain."""
    cfg, folder = run.cfg, run.store.run_folder
    arm = _recorded_arm(run)
    currents = replace(cfg.recording, torque=None)
    parts = _both(run, arm, currents, [1.0] * arm.joints)  # unit gains: "torques" are currents
    against = [np.any([x.agreement.runs_against() for x in part], 0) for part in parts]
    unloaded, loaded = map(measurements_of, parts)
    body = TorqueModel(RigidBody(arm), cfg.model)
    found = drive_gains(body, unloaded, loaded, cfg.load.parameters, against[0] & against[1])
    gains, deviation = found.gains.tolist(), found.deviation.tolist()
    joints = {"joints": list(arm.joint_names), "certain": found.certain.tolist()}
    write_json(folder / "gains.json", {**joints, "gain": gains, "deviation": deviation})
    shown = {"gain [N·m/A]": [f"{x:.4g}" for x in gains], "σ": [f"{x:.2g}" for x in deviation]}
    table = pd.DataFrame(shown, pd.Index(arm.joint_names, name="joint"))
    publish(table, folder / "gains", f"Drive gains of {arm.name} (load: {cfg.load.mass:g} kg)", tracker)
    for doubt in (doubts := found.doubts(arm)):
        _log.warning("robot.gains cannot be set: %s", doubt)
    if not doubts:
        _log.info("robot.gains=[%s]", ",".join(shown["gain [N·m/A]"]))


def _warn_doubtful_links(run: RunContext) -> None:
    if doubtful := describe_doubtful_links(_recorded_arm(run)):
        _log.warning("%s; identification starts from the nearest possible ones", doubtful)


STAGES = {
    "check": Stage(show=_show_check, check=_recorded_arm),
    "identify": Stage(lambda run: [model(run)], _show, _warn_doubtful_links),
    "payload": Stage(show=_show_payload, check=_recorded_arm),
    "gains": Stage(show=_show_gains, check=lambda run: (_recorded_arm(run), run.cfg.load.parameters)),
}
