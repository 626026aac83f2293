"""Stage recheck: whether a model that was identified is still right, by a fresh recording."""

import logging
from pathlib import Path

import pandas as pd
import torch
from torch import Tensor

from sidegan.base.storage import read_json, write_json
from sidegan.errors import ConfigError, SideganError
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.recheck import Recheck, recheck
from sidegan.identification.workflow import measurements_of
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identify import recorded_arm
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.check import read_and_check
from sidegan.report.export import publish
from sidegan.report.identification import PARAMETERS
from sidegan.robot import Arm

RESULT = "recheck.json"
log = logging.getLogger(__name__)


def known_model(folder: Path, arm: Arm) -> tuple[TorqueModel, Tensor, Tensor]:
    """The model that a run of identify left: what torque is explained with, its parameters, its errors.

    Raises:
        ConfigError: when the folder holds none, or one of another arm.
    """
    path = folder / PARAMETERS
    try:
        numbers = read_json(path)
        use, errors = numbers["use"], torch.tensor(numbers["rmse"], dtype=torch.float64)
        kinds = {name: name in use["terms"] for name in ("rotor_inertia", "viscous", "coulomb", "offset")}
        stribeck = numbers["stribeck_velocity"]
        terms = Terms(**kinds, stribeck=stribeck is not None, sign_width=numbers["sign_width"])
        model = TorqueModel(RigidBody(arm), terms, stribeck)
        standard = torch.tensor(use["inertial_parameters"], dtype=torch.float64).reshape(-1)
        standard = torch.cat(
            [standard, *(torch.tensor(use["terms"][kind], dtype=torch.float64) for kind in terms.kinds)]
        )
        if numbers["joints"] != list(arm.joint_names):
            raise ConfigError(f"{path} is of an arm with joints {', '.join(numbers['joints'])}")
        return model, model.mapping @ standard, errors
    except (SideganError, KeyError, TypeError, ValueError, RuntimeError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(
            f"known is {str(folder)!r}, expected the folder of a run of +experiment=identify: {error}"
        ) from error


def _show(task: Task, tracker: Tracker) -> None:
    """Check the model by the configured recordings, and leave the verdict in the run's folder."""
    cfg, arm = task.cfg, recorded_arm(task.cfg)
    if not cfg.recordings:
        raise ConfigError("recordings is empty, expected fresh files: 'recordings=[today.csv]'")
    model, parameters, errors = known_model(Path(cfg.known), arm)
    width = model.terms.sign_width
    fresh = read_and_check(cfg.recordings, "validation", arm, cfg.recording, cfg.robot.gains, width)
    found = recheck(model, parameters, errors, measurements_of(fresh))
    change = None if found.change is None else {"what": found.change.what, "clear": found.change.clear}
    numbers = {"verdict": found.verdict, "reasons": found.reasons, "change": change}
    numbers |= {"nmse": found.errors.nmse.tolist(), "rmse": found.errors.rmse.tolist()}
    write_json(task.store.run_folder / RESULT, numbers | {"ratio": found.ratio.tolist()})
    caption = f"The model in {cfg.known}, today"
    publish(_table(found), task.store.run_folder / "recheck", caption, tracker)
    log.info("the model of %s is %s", arm.name, found.verdict)
    for reason in found.reasons:
        log.info("  %s", reason)


def _table(found: Recheck) -> pd.DataFrame:
    left = found.errors.rmse if found.change is None else found.change.left
    columns = {
        "nMSE": found.errors.nmse,
        "RMSE [N·m]": found.errors.rmse,
        "when identified": found.before,
        "with the change": left,
    }
    shown = {name: [f"{x:.3g}" for x in column.tolist()] for name, column in columns.items()}
    return pd.DataFrame(shown, index=pd.Index(found.joint_names, name="joint"))


def _check(task: Task) -> None:
    known_model(Path(task.cfg.known), recorded_arm(task.cfg))


STAGE = Stage(show=_show, check=_check)
