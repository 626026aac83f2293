"""Stages payload and gains: identify a load, or the drive gains, from runs without and with a load."""

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.storage import write_json
from sidegan.errors import ConfigError
from sidegan.identification.identified import measurements_of
from sidegan.identification.model import TorqueModel
from sidegan.identification.payload import VALUES, Payload, drive_gains, identify_payload
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.settings import Config
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identify import recorded_arm
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.check import CheckedRecording, Role, read_and_check
from sidegan.recording.overlap import refuse_shared
from sidegan.recording.settings import Recorded
from sidegan.report.export import publish
from sidegan.robot import Arm

PAYLOAD, GAINS = "payload.json", "gains.json"
_UNITS = ["kg", *["m"] * 3, *["kg·m²"] * 6]
log = logging.getLogger(__name__)


def both(cfg: Config, arm: Arm, gains: list[float] | None) -> list[list[CheckedRecording]]:
    """Recordings without and with the load, checked and preprocessed; a ConfigError if none have it."""
    if not cfg.loaded:
        raise ConfigError("loaded is empty, expected recordings with the load: 'loaded=[a.csv]'")
    files: list[tuple[Recorded, Role]] = [(file, "training") for file in (*cfg.recordings, *cfg.loaded)]
    found = read_and_check(files, arm, cfg.recording, gains, cfg.model.sign_width)
    refuse_shared([(recording.name, recording.statistics.rows) for recording in found])
    count = len(cfg.recordings)
    return [found[:count], found[count:]]


def _payload(run: RunContext, tracker: Tracker) -> None:
    """Identify the load, and write it to the run's folder."""
    cfg = run.cfg
    arm = recorded_arm(run)
    unloaded, loaded = map(measurements_of, both(cfg, arm, cfg.robot.gains))
    found = identify_payload(TorqueModel(RigidBody(arm), cfg.model), unloaded, loaded)
    write_json(run.store.run_folder / PAYLOAD, as_json(found))
    before, after = float(found.without.mean()), float(found.explained.mean())
    caption = (
        f"Load of {arm.name}, in the frame of {found.link}, inertia about the centre of mass; mean nMSE of "
        f"the loaded runs: {before:.3g} modelled without a load, {after:.3g} with this one"
    )
    publish(_table(found), run.store.run_folder / "payload", caption, tracker)
    mass, sigma = float(found.values[0]), float(found.deviation[0])
    place = ", ".join(f"{x:.4f} ± {s:.1g}" for x, s in zip(found.values[1:4], found.deviation[1:4]))
    words = f"{mass:.3f} ± {sigma:.1g} kg, centre of mass ({place}) m in the frame of {found.link}"
    log.info(
        "load: %s", words if found.certain else f"none that can be detected ({mass:.2g} ± {sigma:.1g} kg)"
    )


def as_json(found: Payload) -> dict[str, Any]:
    """The load as JSON values: SI units, inertia about the centre of mass in ``VALUES``' order."""
    return {
        "link": found.link,
        "certain": found.certain,
        **dict(zip(VALUES, found.values.tolist())),
        "deviation": dict(zip(VALUES, found.deviation.tolist())),
        "inertial_parameters": found.body.tolist(),
        "least_squares": found.estimate.tolist(),
        "covariance": found.covariance.tolist(),
        "nmse": {"without": found.without.tolist(), "with": found.explained.tolist()},
    }


def _table(found: Payload) -> pd.DataFrame:
    rows = {"value": found.values.tolist(), "σ": found.deviation.tolist()}
    shown = {name: [f"{x:.4g}" for x in column] for name, column in rows.items()}
    return pd.DataFrame({**shown, "unit": _UNITS}, index=pd.Index(VALUES, name="load"))


def _gains(run: RunContext, tracker: Tracker) -> None:
    """Identify the gains, and write them to the run's folder; log them as a setting if all are certain."""
    cfg = run.cfg
    arm = recorded_arm(run)
    folder = run.store.run_folder
    currents = replace(cfg, recording=replace(cfg.recording, torque=None))
    parts = both(currents, arm, [1.0] * arm.joints)  # unit gains: "torques" are currents
    against = [np.any([x.agreement.runs_against() for x in part], 0) for part in parts]
    model = TorqueModel(RigidBody(arm), cfg.model)
    unloaded, loaded = map(measurements_of, parts)
    found = drive_gains(model, unloaded, loaded, cfg.load.parameters, against[0] & against[1])
    gains, deviation = found.gains.tolist(), found.deviation.tolist()
    joints = {"joints": list(arm.joint_names), "certain": found.certain.tolist()}
    write_json(folder / GAINS, {**joints, "gain": gains, "deviation": deviation})
    shown = {"gain [N·m/A]": [f"{x:.4g}" for x in gains], "σ": [f"{x:.2g}" for x in deviation]}
    table = pd.DataFrame(shown, pd.Index(arm.joint_names, name="joint"))
    publish(table, folder / "gains", f"Drive gains of {arm.name} (load: {cfg.load.mass:g} kg)", tracker)
    for doubt in (doubts := found.doubts(arm)):
        log.warning("robot.gains cannot be set: %s", doubt)
    if not doubts:
        log.info("robot.gains=[%s]", ",".join(shown["gain [N·m/A]"]))


def _check_gains(run: RunContext) -> None:
    recorded_arm(run)
    _ = run.cfg.load.parameters


STAGES = {
    "payload": Stage(show=_payload, check=recorded_arm),
    "gains": Stage(show=_gains, check=_check_gains),
}
