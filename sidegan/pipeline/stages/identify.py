"""Stage identify: recordings of a real arm to a validated, physically consistent model of it."""

import hashlib
import logging
import shutil
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from sidegan.base.storage import read_json, replacing, write_json
from sidegan.errors import ConfigError, RecordingError
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.stages import check
from sidegan.pipeline.stages.check import CHECK
from sidegan.pipeline.stages.identify_fit import fitted
from sidegan.pipeline.stages.identify_read import examined
from sidegan.pipeline.stages.identify_results import REPORT, VERDICT, write_results
from sidegan.pipeline.stamp import Stamp
from sidegan.pipeline.tracking import Tracker
from sidegan.robot import Arm, load_robot, require_consistent

log = logging.getLogger(__name__)

_PARTS = ("check", "identify", "identify_read", "identify_fit", "identify_report", "identify_results")
_CODE = (
    *("robot", "dynamics", "kernels", "recording", "identification", "report.identification", "report.page"),
    *(f"stages.{part}" for part in _PARTS),
)
_PIECE = 2**20  # bytes of a file that are digested at once


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
            _copy(path, store.run_folder / path.name)
            tracker.log_artifact(path, "identify")
    _tell(read_json(folder / VERDICT), store.run_folder, tracker)


def stamp(cfg: Config, store: Store, arm: Arm) -> Stamp:
    """Of what is identified from the configured recordings."""
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
    training = examined(cfg, arm, cfg.recordings, "training")
    validation = examined(cfg, arm, cfg.validation, "validation")
    check.tell([*training, *validation])
    write_json(folder / CHECK, [one.findings.plain() for one in (*training, *validation)])
    write_results(cfg, fitted(cfg, arm, training, validation), folder)


def _tell(verdict: dict[str, Any], folder: Path, tracker: Tracker) -> None:
    """Sum up for people and for MLflow."""
    validation = verdict["validation"]
    log.info("%s: mean nMSE %.4g (%s)", verdict["verdict"], validation["nmse_mean"], validation["kind"])
    for reason in verdict["reasons"]:
        log.info("  %s", reason)
    log.info("report: %s", folder / REPORT)
    tracker.log_metrics({"identify/nmse": validation["nmse_mean"]})


def _copy(source: Path, target: Path) -> None:
    with replacing(target) as neighbour:
        shutil.copyfile(source, neighbour)


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
                while piece := file.read(_PIECE):
                    digest.update(piece)
    except FileNotFoundError as error:
        raise RecordingError(f"there is no file {path}") from error
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error
    return digest.hexdigest()
