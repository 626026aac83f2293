"""Stage identify: recordings of a real arm to a validated, physically consistent model of it."""

import hashlib
import logging
import shutil
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from sidegan.base.storage import read_json, replacing
from sidegan.errors import ConfigError, RecordingError
from sidegan.identification.workflow import Candidates, identify_arm, measurements_of, model_of
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.stamp import Stamp
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.check import CheckedRecording, read_and_check
from sidegan.report.identification import REPORT, VERDICT, Origin, show_checks, write_results
from sidegan.robot import Arm, load_robot, require_consistent

log = logging.getLogger(__name__)

_CODE = ("robot", "motion", "recording", "identification", "report.identification", "report.page")


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Read, check, identify, validate, and leave all results in the run's folder.

    Raises:
        ConfigError: when no recordings are given.
        RecordingError: when one cannot be used.
        RobotError: when the description is not physically consistent and the fit would be pulled towards it.
    """
    if not cfg.recordings:
        raise ConfigError("recordings is empty, expected files to identify from: 'recordings=[a.csv,b.csv]'")
    arm = load_robot(cfg.robot.name)
    if cfg.identify.pull == "logdet":
        require_consistent(arm)
    folder = store.produce(stamp(cfg, store, arm), partial(_make, cfg, arm))
    for path in sorted(folder.iterdir()):
        if path.name != "stamp.json":
            with replacing(store.run_folder / path.name) as neighbour:
                shutil.copyfile(path, neighbour)
            tracker.log_artifact(path, "identify")
    _log(read_json(folder / VERDICT), store.run_folder, tracker)


def checked(cfg: Config, arm: Arm) -> tuple[list[CheckedRecording], list[CheckedRecording]]:
    """Recordings to identify from and to validate on, checked and preprocessed; the check is printed."""
    settings = (arm, cfg.recording, cfg.robot.gains, cfg.model.sign_width)
    training = read_and_check(cfg.recordings, "training", *settings)
    validation = read_and_check(cfg.validation, "validation", *settings)
    show_checks([*training, *validation])
    return training, validation


def stamp(cfg: Config, store: Store, arm: Arm) -> Stamp:
    """Stamp of what is identified from the configured recordings."""
    files = {f"recordings.{i}": Path(name) for i, name in enumerate(cfg.recordings)}
    files |= {f"validation.{i}": Path(name) for i, name in enumerate(cfg.validation)}
    inputs = {"robot": arm.digest, "urdf": _digest(arm.urdf)}
    inputs |= {key: _digest(path) for key, path in files.items()}
    if cfg.identify.library is not None:
        inputs["library"] = _digest(Path(cfg.identify.library))
    settings = {
        "recording": asdict(cfg.recording),
        "model": asdict(cfg.model),
        "identify": asdict(cfg.identify),
        "gains": cfg.robot.gains,
        "names": {key: path.name for key, path in files.items()},
    }
    return store.stamp("identify", f"{arm.name}-{cfg.identify.method}", settings, inputs, _CODE)


def _make(cfg: Config, arm: Arm, folder: Path, work: Path) -> None:
    training, validation = checked(cfg, arm)
    terms, options = asdict(cfg.model), cfg.identify
    model = model_of(arm, terms, terms.pop("stribeck"), measurements_of(training))
    methods: dict[str, dict[str, Any]] = {options.method: dict(options.settings)}
    methods.setdefault("ols", {})
    consistent = ("pull", "strength", "margin", "total_mass")
    methods["consistent"] = {name: getattr(options, name) for name in consistent}
    candidates = Candidates(Path(options.library), options.recommend) if options.library else None
    identified = identify_arm(model, training, validation, methods, candidates)
    groups = {name: asdict(getattr(cfg, name)) for name in ("robot", "recording", "model", "identify")}
    write_results(identified, Origin(_command(cfg), groups, options.library), folder)


def _command(cfg: Config) -> str:
    lists = {"recordings": cfg.recordings, "validation": cfg.validation}
    files = " ".join(f"'{name}=[{','.join(paths)}]'" for name, paths in lists.items() if paths)
    return f"python -m sidegan.run +experiment=identify robot.name={cfg.robot.name} {files}"


def _log(verdict: dict[str, Any], folder: Path, tracker: Tracker) -> None:
    """Sum up for people and for MLflow."""
    validation = verdict["validation"]
    log.info("%s: mean nMSE %.4g (%s)", verdict["verdict"], validation["nmse_mean"], validation["kind"])
    for reason in verdict["reasons"]:
        log.info("  %s", reason)
    log.info("report: %s", folder / REPORT)
    tracker.log_metrics({"identify/nmse": validation["nmse_mean"]})


def _digest(path: Path) -> str:
    """Hexadecimal SHA-256 of a file, or of all files of a folder.

    Raises:
        RecordingError: when it is not there or cannot be read.
    """
    digest = hashlib.sha256()
    try:
        files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        for one in files:
            digest.update(one.name.encode())
            with one.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
    except FileNotFoundError as error:
        raise RecordingError(f"there is no file {path}") from error
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error
    return digest.hexdigest()
