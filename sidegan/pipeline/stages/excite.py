"""Stage excite: the trajectories to execute on an arm, picked from what was made for it, as files."""

from collections.abc import Sequence
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
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.pools import Pool, own_pools
from sidegan.pipeline.stages.selection import pick
from sidegan.pipeline.task import LIBRARY, Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import publish

FOLDER, WHOLE = "trajectories", "all.csv"


def _show(task: Task, tracker: Tracker) -> None:
    """Pick from the configured pools, and write each trajectory and all of them in a row."""
    cfg, folder = task.cfg, task.store.run_folder
    pool = _pool(task)
    if cfg.selection.count > len(pool):
        held = f"{', '.join(cfg.excite)} hold {len(pool)}"
        raise ConfigError(f"selection.count is {cfg.selection.count}, but {held} trajectories")
    chosen = pool.take(pick(task, pool))
    chosen.save(folder / LIBRARY)
    motion = task.trajectory.roll_out(chosen.coefficients, task.trajectory.times(cfg.identification.rate))
    _write(task, motion, folder / FOLDER)
    information = information_of(task.body, task.trajectory, chosen.coefficients)
    criteria = criteria_of(information.stacked(torch.arange(len(chosen))))
    tracker.log_metrics({"excite/condition": criteria.condition, "excite/log_det": criteria.log_det})
    caption = (
        f"{len(chosen)} trajectories of {task.trajectory.period:g} s, condition of the set "
        f"{criteria.condition:.3g}, at {cfg.identification.rate:g} Hz in {folder / FOLDER}"
    )
    caption += f"; checked: {task.constraints.described()}"
    publish(_table(task, chosen, motion), folder / "set", caption, tracker)


def _pool(task: Task) -> Library:
    """All trajectories of the configured pools."""
    parts: dict[str, list[Artifact]] = {}
    for pool in own_pools(task):
        parts.setdefault(pool.name, []).extend(pool.parts)
    together = tuple(part for name in task.cfg.excite for part in parts[name])
    return Pool("excite", None, "excite", together).load(task)


def _write(task: Task, motion: Motion, folder: Path) -> None:
    """One CSV per trajectory, in the order of choice, and one of all in a row."""
    digits = len(str(len(motion.position)))
    for k in range(len(motion.position)):
        one = Motion(motion.time, *(x[k : k + 1] for x in motion[1:]))
        write_bytes(folder / f"{k + 1:0{digits}}.csv", trajectory_csv(task.arm.joint_names, one))
    write_bytes(folder / WHOLE, trajectory_csv(task.arm.joint_names, concatenate(motion)))


def trajectory_csv(names: Sequence[str], motion: Motion) -> bytes:
    """Time [s], then position, velocity and acceleration of every joint [rad or m, s]."""
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


def _check(task: Task) -> None:
    known = dict.fromkeys(pool.name for pool in own_pools(task))
    for name in task.cfg.excite:
        if name not in known:
            raise ConfigError(f"excite names {name!r}, expected some of {', '.join(known)}")


STAGE = Stage(show=_show, check=_check)
