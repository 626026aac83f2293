"""Stage excite: the trajectories to execute on an arm, picked from what was made for it, as files."""

import logging
from pathlib import Path

import pandas as pd
import torch
from torch import Tensor

from sidegan.base.storage import write_bytes
from sidegan.design.criteria import criteria_of
from sidegan.design.information import information_of
from sidegan.errors import ConfigError
from sidegan.library import Library
from sidegan.motion.trajectory import Motion, concatenate
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import LIBRARY, RANDOM, SEEDS, Task
from sidegan.pipeline.stages.common import load
from sidegan.pipeline.stages.selection import pick
from sidegan.pipeline.stamp import Stamp
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import publish

log = logging.getLogger(__name__)

FOLDER, WHOLE = "trajectories", "all.csv"


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Pick from the configured pools, and write each trajectory and all of them in a row.

    Raises:
        ConfigError: when there is no such pool, or more trajectories are wanted than the pools hold.
    """
    task = Task(cfg, store)
    pool = _pool(task)
    if cfg.selection.count > len(pool):
        held = f"{', '.join(cfg.excite)} hold {len(pool)}"
        raise ConfigError(f"selection.count is {cfg.selection.count}, but {held} trajectories")
    chosen = pool.take(pick(task, pool))
    folder = store.run_folder
    chosen.save(folder / LIBRARY)
    motion = task.trajectory.roll_out(chosen.coefficients, task.trajectory.times(cfg.identification.rate))
    _write(task, motion, folder / FOLDER)
    criteria = criteria_of(_information(task, chosen.coefficients))
    facts = {"condition": criteria.condition, "log_det": criteria.log_det}
    tracker.log_metrics({f"excite/{key}": value for key, value in facts.items()})
    caption = (
        f"{len(chosen)} trajectories of {task.trajectory.period:g} s, condition of the set "
        f"{criteria.condition:.3g}, at {cfg.identification.rate:g} Hz in {folder / FOLDER}"
    )
    publish(_table(task, chosen, motion), folder / "set", caption, tracker)


def _pool(task: Task) -> Library:
    """All trajectories of the configured pools."""
    stamps: list[Stamp] = []
    for name in task.cfg.excite:
        if name in task.cfg.gan:
            stamps += [task.library(name, training) for training in task.cfg.trainings]
        elif name in (SEEDS, RANDOM):
            stamps.append(task.seeds if name == SEEDS else task.random_set)
        else:
            known = ", ".join((SEEDS, RANDOM, *task.cfg.gan))
            raise ConfigError(f"excite names {name!r}, expected some of {known}")
    first, *others = (load(task, stamp) for stamp in stamps)
    return first.merge(*others)


def _information(task: Task, c: Tensor) -> Tensor:
    information = information_of(task.body, task.trajectory, c)
    return information.stacked(torch.arange(len(c)))


def _write(task: Task, motion: Motion, folder: Path) -> None:
    """One CSV per trajectory, in the order of choice, and one of all in a row."""
    digits = len(str(len(motion.position)))
    for k in range(len(motion.position)):
        one = Motion(motion.time, *(x[k : k + 1] for x in motion[1:]))
        write_bytes(folder / f"{k + 1:0{digits}}.csv", _csv(task, one))
    write_bytes(folder / WHOLE, _csv(task, concatenate(motion)))


def _csv(task: Task, motion: Motion) -> bytes:
    """Time [s], then position, velocity and acceleration of every joint [rad or m, s]."""
    names = task.arm.joint_names
    columns = ["time", *(f"{kind}_{name}" for kind in ("q", "dq", "ddq") for name in names)]
    rows = torch.cat([motion.time[:, None], *(x[0] for x in motion[1:])], 1)
    return pd.DataFrame(rows.numpy(), columns=columns).to_csv(index=False, float_format="%.9g").encode()


def _table(task: Task, chosen: Library, motion: Motion) -> pd.DataFrame:
    """What each trajectory asks of the arm."""
    arm = task.arm
    torque = task.body.torque(*motion[1:])
    power = (torque * motion.velocity).abs().sum(2)
    clearance = [chosen.margins[name] for name in ("collision", "keep_out") if name in chosen.margins]
    nearest = torch.stack(clearance).amin(0) if clearance else torch.full((len(chosen),), torch.nan)
    return pd.DataFrame(
        {
            "trajectory": range(1, len(chosen) + 1),
            "cond(YᵀY)": [f"{x:.3g}" for x in chosen.fitness.tolist()],
            "peak velocity": _percent((motion.velocity.abs() / arm.velocity_limit).amax((1, 2))),
            "peak torque": _percent((torque.abs() / arm.torque_limit).amax((1, 2))),
            "clearance [m]": ["—" if x != x else f"{x:.3f}" for x in nearest.tolist()],
            "energy [J]": [f"{x:.3g}" for x in torch.trapezoid(power, motion.time, dim=1).tolist()],
        }
    ).set_index("trajectory")


def _percent(share: Tensor) -> list[str]:
    return [f"{x:.0%}" for x in share.tolist()]
