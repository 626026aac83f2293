"""Stage excite: design trajectories for a goal, and write files to execute them."""

import logging
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from sidegan.base.names import counted, plain
from sidegan.controllers import approach, require_exportable
from sidegan.design.search import ConditionGoal
from sidegan.errors import ArtifactError
from sidegan.identification.uncertain import Uncertain
from sidegan.motion.trajectory import Motion
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.sending import Steps, next_steps, order_of
from sidegan.pipeline.tracking import Tracker
from sidegan.plant import Executed, Plant
from sidegan.recording.commanded import FOLDER
from sidegan.report.export import publish
from sidegan.robot import require_consistent
from sidegan.steps.excite import aim_of, excite
from sidegan.steps.trajectories import TrajectorySet

VIEW, GOAL, SET, REHEARSAL = "view.html", "goal", "set", "rehearsal"
_TRAJECTORY = "trajectory", "trajectories"
_EVERY = 0.02  # time between the configurations of a rehearsal whose distances are computed [s]
log = logging.getLogger(__name__)


def _show(run: RunContext, tracker: Tracker) -> None:
    """Design a set, and write its files, tables and page."""
    cfg = run.cfg
    folder = run.store.run_folder
    chosen = excite(
        run.cell, None, cfg.seed, goal=cfg.goal, search=cfg.search, model=cfg.model, known=cfg.known
    )
    slowed = chosen.at_speed(cfg.controllers.speed)
    _delete_old_files(folder)
    durations = chosen.save(folder, replace(cfg.controllers, rehearse=False))  # rehearsed below
    tracker.log_metrics({"excite/condition": slowed.condition})
    steps = next_steps(run, durations)
    caption = [
        f"{counted(len(slowed), *_TRAJECTORY)} of {slowed.family.period:g} s, condition of the set "
        f"{plain(slowed.condition)}, for controllers ({', '.join(cfg.controllers.formats)}"
        f"{_slow(run)}) in {folder / FOLDER}",
        order_of(run, durations),
        _goal(run, chosen.aim, tracker),
        f"checked: {run.cell.constraints.described()}",
        f"effort {run.cell.effort:.0%}" if run.cell.effort < 1 else "",
        _view(run, slowed, steps, tracker),
    ]
    table = slowed.demands(cfg.controllers.rate)
    publish(table, folder / SET, "\n".join(filter(None, caption)), tracker)
    for doubt in chosen.warnings:
        log.warning("%s", doubt)
    if cfg.controllers.rehearse:
        title = f"The set in MuJoCo, with servos, friction and rotors of plant{_slow(run)}"
        publish(_rehearsed(run, slowed), folder / REHEARSAL, title, tracker)


def _delete_old_files(folder: Path) -> None:
    """Delete an earlier run's files that this run might not overwrite."""
    tables = [f"{name}.{kind}" for name in (GOAL, REHEARSAL, SET) for kind in ("csv", "md")]
    for name in (VIEW, *tables):
        (folder / name).unlink(missing_ok=True)


def _goal(run: RunContext, aim: Uncertain | ConditionGoal | None, tracker: Tracker) -> str:
    """Caption on how well the set meets its goal; publishes the table."""
    if not isinstance(aim, Uncertain):
        return ""
    columns = {"before": aim.before, "with the set": aim.deviations}
    shown = {name: [plain(x) for x in column.tolist()] for name, column in columns.items()}
    of = "the description" if run.cfg.known is None else run.cfg.known
    caption = f"Expected standard deviations; those before are from {of}"
    rows = pd.DataFrame(shown, index=pd.Index(aim.purpose.names, name="quantity"))
    publish(rows, run.store.run_folder / GOAL, caption, tracker)
    tracker.log_metrics({"excite/left": aim.left})
    planned = ", at full speed" if _slow(run) else ""
    return f"{aim.purpose.summary(aim.deviations, aim.before)}{planned}, given {of}"


def _slow(run: RunContext) -> str:
    speed = run.cfg.controllers.speed
    return "" if speed == 1 else f", at {speed:.0%} of the speed"


def _view(run: RunContext, slowed: TrajectorySet, steps: Steps, tracker: Tracker) -> str:
    """Write the page that animates the arm, with the next steps; its address for the caption."""
    path = run.store.run_folder / VIEW
    try:
        slowed.view(path, run.cfg.controllers.rate, steps)
    except ArtifactError as error:  # the trajectories are written: the page is optional
        log.warning("there is no %s: %s", VIEW, error)
        return ""
    tracker.log_artifact(path, "view")
    return f"view: {path.resolve().as_uri()}"


def _rehearsed(run: RunContext, slowed: TrajectorySet) -> pd.DataFrame:
    """Tracking error, largest torque and closest approach of each trajectory in MuJoCo."""
    plant = Plant(run.cell.whole_arm, run.cfg.plant)
    family = slowed.family
    times = slowed.family.times(plant.settings.rate)
    rows = []
    for c in slowed.coefficients:
        planned = family.roll_out(c[None], times)
        rows.append(_executed(run, planned, plant.follow(planned)))
    return pd.DataFrame(rows, index=pd.RangeIndex(1, len(rows) + 1, name="trajectory"))


def _executed(run: RunContext, planned: Motion, executed: Executed) -> dict[str, str]:
    """Tracking error, largest torque and closest approach of an execution, as text."""
    error = np.abs(executed.position - planned.position[0]).max(0)
    share = (np.abs(executed.torque) / run.cell.whole_arm.torque_limit).max(0)
    stride = max(1, round(_EVERY * run.cfg.plant.rate))
    nearest = float(run.cell.constraints.nearest(executed.position[::stride])[0].min())
    return {
        "tracking error [rad]": f"{error.max():.2g} ({run.cell.arm.joint_names[error.argmax()]})",
        "largest torque": f"{share.max():.0%} ({run.cell.arm.joint_names[share.argmax()]})",
        "closest [m]": f"{nearest:.3f}" if math.isfinite(nearest) else "—",
    }


def _check(run: RunContext) -> None:
    cell, settings = run.cell, run.cfg.controllers
    if settings.rehearse:  # MuJoCo needs physically consistent links
        require_consistent(cell.arm)
    family = replace(cell.trajectory, period=cell.trajectory.period / settings.speed)
    require_exportable(cell.whole_arm, family, settings)
    if settings.start is not None:
        way = approach(cell.constraints, settings.start, cell.home, settings)
        settings.refuse_long("the path from controllers.start to home", way.duration)
    aim_of(cell, run.cfg.goal, run.cfg.model, run.cfg.known)


STAGES = {"excite": Stage(show=_show, check=_check)}
