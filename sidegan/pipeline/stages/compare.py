"""Stage compare: what differs between two identifications, and whether that is significant."""

import logging
from pathlib import Path

import pandas as pd

from sidegan.base.names import plain
from sidegan.base.storage import write_json
from sidegan.errors import ConfigError
from sidegan.identification.compare import Comparison, compare
from sidegan.pipeline.known import Known, known_model
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identify import recorded_arm
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import publish

RESULT = "compare.json"
log = logging.getLogger(__name__)


def _both(task: Task) -> tuple[Known, Known]:
    """The two models.

    Raises:
        ConfigError: when one is not there, or they explain torque with other parameters.
    """
    arm = recorded_arm(task.cfg)
    first, second = (known_model(Path(folder or ""), arm) for folder in (task.cfg.known, task.cfg.other))
    if first.model.names != second.model.names:
        odd = sorted(set(first.model.names) ^ set(second.model.names))
        raise ConfigError(
            f"the models have other parameters: {', '.join(odd[:8])}; identify with one model=…"
        )
    return first, second


def _show(task: Task, tracker: Tracker) -> None:
    """Compare the models, and leave what differs in the run's folder."""
    cfg, (first, second) = task.cfg, _both(task)
    found = compare(first.model, (first.estimate, first.covariance), (second.estimate, second.covariance))
    folder, joints = task.store.run_folder, first.model.arm.joint_names
    numbers = {"differ": found.differ, "probability": found.probability, "clear": found.clear}
    torques = {"torque": found.torque.tolist(), "uncertain": found.uncertain.tolist()}
    write_json(folder / RESULT, numbers | torques | {"joints": list(joints)})
    publish(_table(found), folder / "compare", f"{cfg.other} less {cfg.known}", tracker)
    worst = int(found.torque.argmax())
    torque = f"torques differ by up to {found.torque[worst]:.1%} ({joints[worst]})"
    if not found.differ:
        log.info("no significant difference (p = %.2g); %s", found.probability, torque)
        return
    listed = ", ".join(f"{name} {x:+.3g} ± {sigma:.1g}" for name, x, sigma in found.clear[:8])
    log.info("the models differ (p = %.1g): %s; %s", found.probability, listed or "all a little", torque)


def _table(found: Comparison) -> pd.DataFrame:
    """A row per parameter, the clearest difference first."""
    ratio = found.difference / found.deviation.clamp_min(1e-300)
    order = ratio.abs().argsort(descending=True)
    columns = {"difference": found.difference, "σ": found.deviation, "in σ": ratio}
    shown = {name: [plain(x) for x in column[order].tolist()] for name, column in columns.items()}
    return pd.DataFrame(shown, index=pd.Index([found.names[k] for k in order.tolist()], name="parameter"))


STAGE = Stage(show=_show, check=_both)
