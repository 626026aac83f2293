"""Stages payload and gains: a load on the last link, and drive gains by a known load."""

import logging
from dataclasses import replace

import numpy as np
import pandas as pd

from sidegan.base.storage import write_json
from sidegan.errors import ConfigError
from sidegan.identification.identified import measurements_of
from sidegan.identification.model import TorqueModel
from sidegan.identification.payload import VALUES, Gains, drive_gains, identify_payload
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.stages.identify import configured_arm
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.checked import CheckedRecording
from sidegan.recording.settings import RecordingSettings
from sidegan.report.export import publish
from sidegan.robot import Arm
from sidegan.steps.identify import read_groups

_UNITS = ["kg", *["m"] * 3, *["kg·m²"] * 6]  # of a load's values
_log = logging.getLogger(__name__)


def _checked(
    run: RunContext, arm: Arm, settings: RecordingSettings, gains: list[float] | None
) -> tuple[list[CheckedRecording], list[CheckedRecording]]:
    """Recordings without and with the load, checked and preprocessed; a ConfigError if none have it."""
    cfg = run.cfg
    if not cfg.loaded:
        raise ConfigError("loaded is empty, expected recordings with the load: 'loaded=[a.csv]'")
    return read_groups(arm, cfg.recordings, cfg.loaded, "loaded", settings, gains, cfg.model.sign_width)


def _show_payload(run: RunContext, tracker: Tracker) -> None:
    """Identify the load, and write it to the run's folder: SI units, inertia about the centre of mass."""
    cfg, folder = run.cfg, run.store.run_folder
    arm = configured_arm(run)
    unloaded, loaded = map(measurements_of, _checked(run, arm, cfg.recording, cfg.robot.gains))
    found = identify_payload(TorqueModel(RigidBody(arm), cfg.model), unloaded, loaded)
    values, deviation = found.values.tolist(), found.deviation.tolist()
    content = {
        "link": found.link,
        "certain": found.certain,
        **dict(zip(VALUES, values)),
        "deviation": dict(zip(VALUES, deviation)),
        "inertial_parameters": found.body.tolist(),
        "least_squares": found.estimate.tolist(),
        "covariance": found.covariance.tolist(),
        "nmse": {"without": found.without.tolist(), "with": found.explained.tolist()},
    }
    write_json(folder / "payload.json", content)
    columns = {"value": [f"{x:.4g}" for x in values], "σ": [f"{x:.4g}" for x in deviation], "unit": _UNITS}
    table = pd.DataFrame(columns, index=pd.Index(VALUES, name="load"))
    caption = (
        f"Load of {arm.name}, in the frame of {found.link}, inertia about the centre of mass; mean nMSE of "
        f"the loaded runs: {found.without.mean():.3g} modelled without a load, {found.explained.mean():.3g} "
        f"with this one"
    )
    publish(table, folder / "payload", caption, tracker)
    if found.certain:
        mass = f"{values[0]:.3f} ± {deviation[0]:.1g} kg"
        place = ", ".join(f"{x:.4f} ± {s:.1g}" for x, s in zip(values[1:4], deviation[1:4]))
        _log.info("load: %s, centre of mass (%s) m in the frame of %s", mass, place, found.link)
    else:
        _log.info("load: none that can be detected (%.2g ± %.1g kg)", values[0], deviation[0])


def _show_gains(run: RunContext, tracker: Tracker) -> None:
    """Identify the gains, and write them to the run's folder; log them as a setting if all are certain."""
    cfg, folder = run.cfg, run.store.run_folder
    arm = configured_arm(run)
    currents = replace(cfg.recording, torque=None, effort="current")  # the only effort that a bag has
    parts = _checked(run, arm, currents, [1.0] * arm.joints)  # unit gains: "torques" are currents
    against = [np.any([x.agreement.runs_against() for x in part], 0) for part in parts]
    unloaded, loaded = map(measurements_of, parts)
    model = TorqueModel(RigidBody(arm), cfg.model)
    found = drive_gains(model, unloaded, loaded, cfg.load.parameters, against[0] & against[1])
    gains, deviation = found.gains.tolist(), found.deviation.tolist()
    joints = {"joints": list(arm.joint_names), "certain": found.certain.tolist()}
    write_json(folder / "gains.json", {**joints, "gain": gains, "deviation": deviation})
    table = gains_table(arm, found)
    publish(table, folder / "gains", f"Drive gains of {arm.name} (load: {cfg.load.mass:g} kg)", tracker)
    for doubt in (doubts := found.doubts(arm, run.cfg.recording.reverse)):
        _log.warning("robot.gains cannot be set: %s", doubt)
    if not doubts:
        _log.info("robot.gains=[%s]", ",".join(table.iloc[:, 0]))


def gains_table(arm: Arm, found: Gains) -> pd.DataFrame:
    """Gains and their deviations as text, a row for each joint."""
    units = dict.fromkeys("N/A" if slides else "N·m/A" for slides in arm.prismatic)
    gains = [f"{x:.4g}" for x in found.gains.tolist()]
    shown = {f"gain [{' or '.join(units)}]": gains, "σ": [f"{x:.2g}" for x in found.deviation.tolist()]}
    return pd.DataFrame(shown, pd.Index(arm.joint_names, name="joint"))


STAGES = {
    "payload": Stage(show=_show_payload, check=configured_arm),
    "gains": Stage(show=_show_gains, check=lambda run: (configured_arm(run), run.cfg.load.parameters)),
}
