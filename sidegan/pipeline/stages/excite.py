"""Stage excite: design trajectories for a goal, and write files and instructions to execute them."""

import logging
import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from shlex import quote

import numpy as np
import pandas as pd

from sidegan.base.names import counted, plain
from sidegan.controllers import APPROACH, SHELL, approach, require_exportable
from sidegan.design.beside import compile_beside
from sidegan.errors import ArtifactError
from sidegan.identification.goals import Uncertain
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.tracking import Tracker
from sidegan.plant import Plant
from sidegan.recording.commanded import FOLDER
from sidegan.report.export import publish
from sidegan.robot import require_consistent, robot_settings, setting
from sidegan.steps.excite import aim_of, excite
from sidegan.steps.trajectories import TrajectorySet

VIEW, GOAL, SET, REHEARSAL = "view.html", "goal", "set", "rehearsal"
_EVERY = 0.02  # time between the configurations of a rehearsal whose distances are computed [s]

_FIRST = 0.25  # speed of the first run, as a share of the planned speed
_PER_RUN = ("controllers.speed=", "controllers.start=", "controllers.rehearse=")  # overrides not to repeat
_SLOWLY = "First slowly: the same set at a quarter of the speed, with a path from where the arm stands:"
_LOG = "Log positions and torques or currents throughout, run the whole set at least twice; then:"
_ACTION = "/joint_trajectory_controller/follow_joint_trajectory"
_GOAL = "control_msgs/action/FollowJointTrajectory"
_log = logging.getLogger(__name__)


def _show(run: RunContext, tracker: Tracker) -> None:
    """Design a set, and write its files, tables and page."""
    cfg, folder = run.cfg, run.store.run_folder
    speed = cfg.controllers.speed
    pace = "" if speed == 1 else f", at {speed:.0%} of the speed"
    chosen = excite(
        run.cell, None, cfg.seed, goal=cfg.goal, search=cfg.search, model=cfg.model, known=cfg.known
    )
    slowed = chosen.at_speed(speed)
    for name in (VIEW, *(f"{name}.{kind}" for name in (GOAL, REHEARSAL, SET) for kind in ("csv", "md"))):
        (folder / name).unlink(missing_ok=True)  # of an earlier run: this one might not overwrite it
    durations = chosen.save(folder, replace(cfg.controllers, rehearse=False))  # rehearsed below
    tracker.log_metrics({"excite/condition": slowed.condition})
    view = folder / VIEW
    try:
        slowed.view(view, cfg.controllers.rate, _next_steps(run, durations))
        tracker.log_artifact(view, "view")
    except ArtifactError as error:  # the trajectories are written: the page is optional
        _log.warning("there is no %s: %s", VIEW, error)
    caption = [
        f"{counted(len(slowed), 'trajectory', 'trajectories')} of {slowed.family.period:g} s, condition of "
        f"the set {plain(slowed.condition)}, for controllers ({', '.join(cfg.controllers.formats)}{pace}) in "
        f"{folder / FOLDER}",
        _order(run, durations),
        _goal(run, chosen.aim, tracker) if isinstance(chosen.aim, Uncertain) else "",
        f"checked: {run.cell.constraints.described()}",
        f"effort {run.cell.effort:.0%}" if run.cell.effort < 1 else "",
        f"view: {view.resolve().as_uri()}" if view.exists() else "",
    ]
    table = slowed.demands(cfg.controllers.rate)
    publish(table, folder / SET, "\n".join(filter(None, caption)), tracker)
    for doubt in chosen.warnings:
        _log.warning("%s", doubt)
    if cfg.controllers.rehearse:
        title = f"The set in MuJoCo, with servos, friction and rotors of plant{pace}"
        publish(_rehearsed(run, slowed), folder / REHEARSAL, title, tracker)


def _goal(run: RunContext, aim: Uncertain, tracker: Tracker) -> str:
    """Caption on how well the set meets its goal; publishes the table."""
    columns = {"before": aim.before, "with the set": aim.deviations}
    shown = {name: [plain(x) for x in column.tolist()] for name, column in columns.items()}
    of = "the description" if run.cfg.known is None else run.cfg.known
    caption = f"Expected standard deviations; those before are from {of}"
    rows = pd.DataFrame(shown, index=pd.Index(aim.purpose.names, name="quantity"))
    publish(rows, run.store.run_folder / GOAL, caption, tracker)
    tracker.log_metrics({"excite/left": aim.remaining})
    planned = ", at full speed" if run.cfg.controllers.speed != 1 else ""
    return f"{aim.purpose.summary(aim.deviations, aim.before)}{planned}, given {of}"


def _rehearsed(run: RunContext, slowed: TrajectorySet) -> pd.DataFrame:
    """Tracking error, largest torque and closest approach of each trajectory in MuJoCo, as text."""
    arm, joints, rate = run.cell.whole_arm, run.cell.arm.joint_names, run.cfg.plant.rate
    plant = Plant(arm, run.cfg.plant)
    rows = []
    for c in slowed.coefficients:
        planned = slowed.family.roll_out(c[None], slowed.family.times(rate))
        executed = plant.follow(planned)
        error = np.abs(executed.position - planned.position[0]).max(0)
        worst = int(error.argmax())
        unit = "m" if arm.prismatic[worst] else "rad"
        share = (np.abs(executed.torque) / arm.torque_limit).max(0)
        seen = executed.position[:: max(1, round(_EVERY * rate))]
        nearest = float(run.cell.constraints.nearest(seen)[0].min())
        row = {
            "tracking error": f"{error[worst]:.2g} {unit} ({joints[worst]})",
            "largest torque": f"{share.max():.0%} ({joints[share.argmax()]})",
            "closest [m]": f"{nearest:.3f}" if math.isfinite(nearest) else "—",
        }
        rows.append(row)
    return pd.DataFrame(rows, index=pd.RangeIndex(1, len(rows) + 1, name="trajectory"))


def _order(run: RunContext, durations: Mapping[str, float]) -> str:
    """Which files to send in which order, how long each takes, and where the arm must stand before."""
    groups = [(length, [*names]) for length, names in groupby(durations, lambda name: plain(durations[name]))]
    parts = [
        f"{names[0]} ({length} s)" if len(names) == 1 else f"{names[0]} … {names[-1]} ({length} s each)"
        for length, names in groups
    ]
    ways = APPROACH in durations
    settings, cell = run.cfg.controllers, run.cell
    q = settings.start or [] if ways else np.linalg.solve(settings.matrix(cell.arm), cell.home).tolist()
    where = ", ".join(f"{name} {x:.6g}" for name, x in zip(cell.arm.joint_names, q))
    place = f"at controllers.start: {where}"
    if not ways:
        place = f"at home first: {where} (controllers.start=[…] writes a path there)"
    return f"to be sent in this order: {', '.join(parts)}; the arm must stand {place}"


def _next_steps(run: RunContext, durations: Mapping[str, float]) -> list[tuple[str, str]]:
    """Next steps with the set, a sentence and a command each; the slow run comes first."""
    speed, start = run.cfg.controllers.speed, run.cfg.controllers.start
    folder = run.store.run_folder.resolve()
    robot = robot_settings(run.cell.robot, run.cell.setup)
    pace = "at the planned speed" if speed == 1 else f"at {speed:.0%} of the planned speed"
    then = f"{'Then this set' if speed > _FIRST else 'This set'}, {pace}, {_order(run, durations)}."
    if run.cell.arm.locked:
        then += f" Standing still: {run.cell.arm.locked}."
    where = "…" if start is None else ",".join(f"{x:.6g}" for x in start)
    kept = [override for override in run.overrides if not override.startswith(_PER_RUN)]
    new = [f"controllers.speed={_FIRST}", f"controllers.start=[{where}]"]
    same = " ".join(map(quote, kept)) or f"+experiment=excite {robot}"
    slower = f"sidegan {same} {' '.join(map(quote, new))} {setting('hydra.run.dir', f'{folder}-slow')}"
    identify = (
        f"sidegan +experiment=identify {robot} 'recordings=[log.csv]' validation=0.25 \\\n"
        f"    recording=excite {setting('recording.sent', folder)}"
    )
    if run.cfg.controllers.coupling:
        identify += f" {setting('recording.coupling', run.cfg.controllers.coupling)}"
    steps = [(_SLOWLY, slower), (then, _send(run, folder / FOLDER, durations)), (_LOG, identify)]
    return steps if speed > _FIRST else steps[1:]


def _send(run: RunContext, folder: Path, durations: Mapping[str, float]) -> str:
    """Commands that send the goals of a set one by one, or the files if it has no goals."""
    formats = run.cfg.controllers.formats
    if "ros2" not in formats:
        ending = "script" if "urscript" in formats else "csv"
        return "\n".join(f"{folder / name}.{ending}" for name in durations)
    large = max((folder / f"{name}.yaml").stat().st_size for name in durations) >= SHELL
    goal = "--stdin < $1.yaml" if large else '"$(cat $1.yaml)"'
    needs = "  # too long for a command line: --stdin needs ROS 2 Jazzy or newer" if large else ""
    send = f"send() {{ ros2 action send_goal {_ACTION} \\\n    {_GOAL} {goal}; }}{needs}"
    return "\n".join([f"cd {quote(str(folder))}", send, *(f"send {name}" for name in durations)])


def _check(run: RunContext) -> None:
    compile_beside()  # in parallel with the compilation below
    cell, settings = run.cell, run.cfg.controllers
    if settings.rehearse:  # MuJoCo needs physically consistent links
        require_consistent(cell.arm)
    family = replace(cell.trajectory, period=cell.trajectory.period / settings.speed)
    require_exportable(cell.whole_arm, family, settings)
    if settings.start is not None:
        start = (settings.matrix(cell.arm) @ settings.start).tolist()
        way = approach(cell.constraints, start, cell.home, settings)
        settings.refuse_long("the path from controllers.start to home", way.duration)
    aim_of(cell, run.cfg.goal, run.cfg.model, run.cfg.known)


STAGES = {"excite": Stage(show=_show, check=_check)}
