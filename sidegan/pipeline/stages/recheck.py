"""Stage recheck: whether a model that was identified is still right, by a fresh recording."""

import logging
from pathlib import Path

import pandas as pd

from sidegan.base.names import plain
from sidegan.base.storage import write_json
from sidegan.errors import ConfigError
from sidegan.identification.recheck import Recheck, expected_error, recheck
from sidegan.identification.workflow import measurements_of
from sidegan.pipeline.known import known_model
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identify import recorded_arm
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.check import read_and_check
from sidegan.report.export import publish

RESULT = "recheck.json"
log = logging.getLogger(__name__)


def _show(task: Task, tracker: Tracker) -> None:
    """Check the model by the configured recordings, and leave the verdict in the run's folder."""
    cfg, arm = task.cfg, recorded_arm(task.cfg)
    if not cfg.recordings:
        raise ConfigError("recordings is empty, expected fresh files: 'recordings=[today.csv]'")
    known = known_model(Path(cfg.known or ""), arm)
    width = known.model.terms.sign_width
    fresh = read_and_check(cfg.recordings, "validation", arm, cfg.recording, cfg.robot.gains, width)
    once = min(one.repetitions[0] for one in fresh)
    before = expected_error(known.worst, known.repetitions, once)
    found = recheck(known.model, known.parameters, known.covariance, before, measurements_of(fresh))
    change = None if found.change is None else {"what": found.change.what, "clear": found.change.clear}
    told = {"verdict": found.verdict, "statement": found.statement}
    numbers = {**told, "reasons": found.reasons, "change": change}
    numbers |= {"nmse": found.errors.nmse.tolist(), "rmse": found.errors.rmse.tolist()}
    write_json(task.store.run_folder / RESULT, numbers | {"ratio": found.ratio.tolist()})
    caption = f"The model in {cfg.known}, today"
    publish(_table(found), task.store.run_folder / "recheck", caption, tracker)
    log.info("the model of %s is %s", arm.name, found.statement)
    for reason in found.reasons:
        log.info("  %s", reason)


def _table(found: Recheck) -> pd.DataFrame:
    left = found.errors.rmse if found.change is None else found.change.left
    columns = {
        "nMSE": found.errors.nmse,
        "RMSE [N·m]": found.errors.rmse,
        "worst when identified": found.before,
        "with the change": left,
    }
    shown = {name: [plain(x) for x in column.tolist()] for name, column in columns.items()}
    return pd.DataFrame(shown, index=pd.Index(found.joint_names, name="joint"))


def _check(task: Task) -> None:
    known_model(Path(task.cfg.known or ""), recorded_arm(task.cfg))


STAGE = Stage(show=_show, check=_check)
