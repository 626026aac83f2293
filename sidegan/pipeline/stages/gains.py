"""Stage gains: torque per motor current of each joint, from recordings without and with a known load."""

import logging
from dataclasses import replace

import pandas as pd

from sidegan.base.storage import write_json
from sidegan.identification.drive_gains import drive_gains
from sidegan.identification.model import TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identify import recorded_arm
from sidegan.pipeline.stages.payload import both
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import publish

RESULT = "gains.json"
log = logging.getLogger(__name__)


def _show(task: Task, tracker: Tracker) -> None:
    """Find the gains, and leave them in the run's folder; as a setting too, if all are certain."""
    cfg, arm, folder = task.cfg, recorded_arm(task), task.store.run_folder
    currents = replace(cfg, recording=replace(cfg.recording, torque=None))
    unloaded, loaded = both(currents, arm, [1.0] * arm.joints)  # a torque then is a current
    found = drive_gains(TorqueModel(RigidBody(arm), cfg.model), unloaded, loaded, cfg.load.parameters)
    each = {"gain": found.gains.tolist(), "deviation": found.deviation.tolist()}
    joints = {"joints": list(arm.joint_names), "certain": found.certain.tolist()}
    write_json(folder / RESULT, {**joints, **each})
    shown = pd.DataFrame(
        {"gain [N·m/A]": [f"{x:.4g}" for x in each["gain"]], "σ": [f"{x:.2g}" for x in each["deviation"]]},
        index=pd.Index(arm.joint_names, name="joint"),
    )
    publish(shown, folder / "gains", f"Drive gains of {arm.name}, by a load of {cfg.load.mass:g} kg", tracker)
    for doubt in (doubts := found.doubts(arm)):
        log.warning("no setting robot.gains: %s", doubt)
    if not doubts:
        log.info("robot.gains=[%s]", ",".join(f"{x:.4g}" for x in each["gain"]))


def _check(task: Task) -> None:
    recorded_arm(task)
    _ = task.cfg.load.parameters


STAGE = Stage(show=_show, check=_check)
