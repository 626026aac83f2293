"""Stage excite: the trajectories to execute on an arm, designed for what they are to tell, as files."""

import logging
from math import isfinite
from pathlib import Path

import pandas as pd
import torch
from torch import Tensor

from sidegan.base.names import counted, plain
from sidegan.controllers import POINTS, SCRIPTED, approach, deliver, least_rate, slower
from sidegan.design.criteria import condition_of
from sidegan.design.information import information_of
from sidegan.design.search import Condition, design_set
from sidegan.errors import ArtifactError, ConfigError, InfeasibleError
from sidegan.identification.goals import usual_torque
from sidegan.identification.uncertain import Uncertain, unmeasured
from sidegan.library import Library
from sidegan.library.measure import measured
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.context import LIBRARY, RunContext
from sidegan.pipeline.known import known_model
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.rehearsal import rehearsed
from sidegan.pipeline.stages.sending import Steps, next_steps, order_of
from sidegan.pipeline.stages.worth import tell_worthless
from sidegan.pipeline.tracking import Tracker
from sidegan.recording.sent import FOLDER
from sidegan.report.export import publish
from sidegan.robot import placeholder_links, require_consistent
from sidegan.validity import check
from sidegan.validity.home import refuse_degrees

VIEW, GOAL, SET, REHEARSAL = "view.html", "goal", "set", "rehearsal"
_LOOKED_AT = 25.0  # [Hz] at which distances are looked at
_TRAJECTORY = "trajectory", "trajectories"
_PRINTED = 1e-4  # by how much a rate that a message names may be rounded
_RATES = {"velocity": (1, "/s"), "acceleration": (2, "/s²"), "jerk": (3, "/s³")}  # derivatives, by order
_UNLIMITED = torch.tensor(torch.inf)
log = logging.getLogger(__name__)


def _show(run: RunContext, tracker: Tracker) -> None:
    """Design a set, and write each trajectory and all of them in a row."""
    cfg, folder = run.cfg, run.store.run_folder
    aim = _aim(run)
    c = design_set(run.cell.problem, aim, cfg.goal.count, cfg.search, run.number("excite"))
    chosen = measured(run.cell.constraints, run.cell.trajectory, c, "excite")
    chosen = chosen.take(_energy(run, run.cell.trajectory, chosen).argsort())
    family, slowed = _as_run(run, chosen)
    _forget(folder)
    chosen.save(folder / LIBRARY)
    durations = deliver(run.cell.constraints, family, slowed.coefficients, cfg.controllers, folder / FOLDER)
    condition = condition_of(information_of(run.cell.body, family, slowed.coefficients).sum(0))
    tracker.log_metrics({"excite/condition": condition})
    table = _table(run, family, slowed)
    steps = next_steps(run, durations)
    caption = [
        f"{counted(len(slowed), *_TRAJECTORY)} of {family.period:g} s, condition of the set "
        f"{plain(condition)}, for controllers ({', '.join(cfg.controllers.formats)}"
        f"{_slow(run)}) in {folder / FOLDER}",
        order_of(run, durations),
        _goal(run, aim, tracker),
        f"checked: {run.cell.constraints.described()}",
        f"effort {run.cell.effort:.0%}" if run.cell.effort < 1 else "",
        _view(run, family, slowed, (table, steps), tracker),
    ]
    publish(table, folder / SET, "; ".join(filter(None, caption)), tracker)
    if doubt := tell_worthless(run, aim, chosen.coefficients, condition):
        log.warning("%s", doubt)
    if cfg.controllers.rehearse:
        said = f"The set in MuJoCo, with servos, friction and rotors of plant{_slow(run)}"
        publish(rehearsed(run, family, slowed.coefficients), folder / REHEARSAL, said, tracker)


def _forget(folder: Path) -> None:
    """Delete what another run left in the folder and this one may not write anew."""
    tables = [f"{name}.{kind}" for name in (GOAL, REHEARSAL, SET) for kind in ("csv", "md")]
    for name in (VIEW, *tables):
        (folder / name).unlink(missing_ok=True)


def _aim(run: RunContext) -> Uncertain | Condition:
    """Goal of a set, before anything of it is designed; a ConfigError where it does not fit the arm."""
    cfg = run.cfg
    if cfg.goal.objective == "condition":
        if cfg.known is not None:
            raise ConfigError("goal.objective=condition knows no model: leave out known=, or choose another")
        return Condition(run.cell.problem)
    if cfg.known is None:
        return unmeasured(run.cell.body, cfg.model, cfg.goal)
    known = known_model(Path(cfg.known), run.cell.arm)
    certainty, rate = known.certainty, known.rate
    if cfg.goal.noise is not None:  # what is measured next has another noise than the recordings
        certainty, rate = 1 / cfg.goal.deviation(usual_torque(run.cell.body)), cfg.goal.rate
    return Uncertain(known.model, known.covariance, certainty, rate, cfg.goal.objective, identified=True)


def _goal(run: RunContext, aim: Uncertain | Condition, tracker: Tracker) -> str:
    """Caption on what the set makes of its goal; the table of it is published."""
    if isinstance(aim, Condition):
        return ""
    columns = {"before": aim.before, "with the set": aim.deviations}
    shown = {name: [plain(x) for x in column.tolist()] for name, column in columns.items()}
    of = "the description" if run.cfg.known is None else run.cfg.known
    caption = f"Standard deviations that are to be expected, before: by {of}"
    rows = pd.DataFrame(shown, index=pd.Index(aim.purpose.names, name="wanted"))
    publish(rows, run.store.run_folder / GOAL, caption, tracker)
    tracker.log_metrics({"excite/left": aim.left})
    planned = ", at the whole speed" if _slow(run) else ""
    return f"{aim.purpose.said(aim.deviations, aim.before)}{planned}, beside {of}"


def _as_run(run: RunContext, chosen: Library) -> tuple[Trajectory, Library]:
    """The set at the chosen speed, as its files have it, and the family that it then is of.

    What cannot be run slower is refused: accelerations may help to hold an arm that is too weak.

    Raises:
        InfeasibleError: with the trajectory, and what it would violate.
    """
    speed = run.cfg.controllers.speed
    if speed == 1:
        return run.cell.trajectory, chosen
    family, c = slower(run.cell.trajectory, chosen.coefficients, speed)
    found = check(run.cell.constraints, family, c)
    if not found.valid.all():
        first = int((~found.valid).nonzero()[0])
        raise InfeasibleError(
            f"trajectory {first + 1} cannot be run at {speed:.0%} of the speed: {found.failures(first)[0]}; "
            "plan a slower one: robot.effort or trajectory.period"
        )
    return family, measured(run.cell.constraints, family, c, "excite")


def _slow(run: RunContext) -> str:
    speed = run.cfg.controllers.speed
    return "" if speed == 1 else f", at {speed:.0%} of the speed"


def _view(
    run: RunContext, family: Trajectory, slowed: Library, below: tuple[pd.DataFrame, Steps], tracker: Tracker
) -> str:
    """Write the page on which the arm moves, with a table and steps below; where it is, for the caption."""
    from sidegan.report.viewer import view_of, write_view

    path = run.store.run_folder / VIEW
    titles = [f"{k} · cond {plain(fitness)}" for k, fitness in enumerate(slowed.fitness.tolist(), 1)]
    try:
        view = view_of(run.cell.constraints, family, slowed.coefficients, titles, run.cell.whole_arm)
        write_view(view, path, *below)
    except ArtifactError as error:  # the trajectories are there, which is what counts
        log.warning("there is no %s: %s", VIEW, error)
        return ""
    tracker.log_artifact(path, "view")
    return f"to look at: {path.resolve().as_uri()}"


def _energy(run: RunContext, family: Trajectory, slowed: Library) -> Tensor:
    """Mechanical work of the joints, whether they drive or brake [J], (N,)."""
    motion = family.roll_out(slowed.coefficients, family.times(run.cfg.controllers.rate))
    power = (run.cell.body.drive_torque(*motion[1:]) * motion.velocity).abs().sum(2)
    return torch.trapezoid(power, motion.time, dim=1)


def _table(run: RunContext, family: Trajectory, slowed: Library) -> pd.DataFrame:
    """Table of what each trajectory asks of the arm, as its files have it."""
    arm, times = run.cell.whole_arm, family.times(run.cfg.controllers.rate)
    torque = run.cell.body.drive_torque(*family.roll_out(slowed.coefficients, times)[1:])
    q = family.derivative(slowed.coefficients, family.times(_LOOKED_AT), 0)
    nearest = run.cell.constraints.nearest(q.flatten(0, 1))[0].view(len(q), -1).amin(1)
    known = bool(arm.inertial_parameters.any()) and not placeholder_links(arm)
    slides = arm.prismatic.tolist()
    limits = {"velocity": arm.velocity_limit, **arm.higher_limits}
    columns: dict[str, list[str] | str] = {"cond(YᵀY)": [plain(x) for x in slowed.fitness.tolist()]}
    for name, (order, per) in _RATES.items():
        units = [f"{'m' if one else 'rad'}{per}" for one in slides]
        x = family.derivative(slowed.coefficients, times, order)
        columns[f"peak {name}"] = _peaks(x, limits.get(name, _UNLIMITED), units)
    efforts = ["N" if one else "N·m" for one in slides]
    columns["peak torque"] = _peaks(torque, arm.torque_limit, efforts) if known else "—"
    columns["clearance [m]"] = [f"{x:.3f}" if isfinite(x) else "—" for x in nearest.tolist()]
    columns["energy [J]"] = [plain(x) for x in _energy(run, family, slowed).tolist()] if known else "—"
    return pd.DataFrame(columns, pd.RangeIndex(1, len(slowed) + 1, name="trajectory"))


def _peaks(x: Tensor, limit: Tensor, units: list[str]) -> list[str]:
    """Largest value of joints (N, T, J) beside their limits (J,), as a share and with its unit, (N,)."""
    most = x.abs().amax(1)
    limited = bool(limit.isfinite().any())
    share, joint = (most / limit if limited else most).max(1)
    values = [f"{plain(float(row[j]))} {units[j]}" for row, j in zip(most, joint.tolist())]
    return [f"{one:.0%}, {value}" for one, value in zip(share.tolist(), values)] if limited else values


def _require_rate(run: RunContext) -> None:
    """Refuse tables of too few points for the highest harmonic."""
    settings, family = run.cfg.controllers, run.cfg.trajectory
    least = settings.speed * least_rate(family.harmonics, family.period)
    if "csv" in settings.formats and settings.rate < least * (1 - _PRINTED):
        raise ConfigError(
            f"controllers.rate is {settings.rate:g} Hz, expected {least:.5g} or more: {POINTS} points per "
            f"period of the highest of trajectory.harmonics={family.harmonics}"
        )


def _require_places(run: RunContext) -> None:
    """Refuse a start that is in degrees, for another arm, or with no way to home."""
    arm, settings = run.cell.whole_arm, run.cfg.controllers
    if settings.start is None:
        return
    if len(settings.start) != arm.joints:
        raise ConfigError(
            f"controllers.start is {settings.start}, expected the positions of {arm.joints} joints, "
            f"{', '.join(arm.joint_names)}"
        )
    refuse_degrees(arm, settings.start, "controllers.start")
    approach(run.cell.constraints, settings.start, tuple(run.cell.trajectory.home or ()), settings)


def _check(run: RunContext) -> None:
    if run.cfg.controllers.rehearse:  # in MuJoCo, which could not move others
        require_consistent(run.cell.arm)
    _require_rate(run)
    _require_places(run)
    _aim(run)
    slides = run.cell.arm.prismatic
    if "urscript" in run.cfg.controllers.formats and (run.cell.arm.joints != SCRIPTED or slides.any()):
        sliding = f", of which {run.cell.arm.named(slides)} slide" if slides.any() else ""
        raise ConfigError(
            f"controllers.formats has urscript, which moves {SCRIPTED} joints that turn; "
            f"{run.cell.arm.name} has {run.cell.arm.joints}{sliding}"
        )


STAGES = {"excite": Stage(show=_show, check=_check)}
