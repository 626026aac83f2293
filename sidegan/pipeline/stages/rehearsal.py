"""The set as an arm in MuJoCo executes it, under servos and with friction, before anything moves."""

import math

import pandas as pd

from sidegan.motion.trajectory import Motion
from sidegan.pipeline.context import RunContext
from sidegan.plant import Executed, Plant
from sidegan.steps.trajectories import TrajectorySet

_EVERY = 0.02  # [s] between the configurations whose distances are looked at


def rehearsed(run: RunContext, slowed: TrajectorySet) -> pd.DataFrame:
    """Tracking error, largest torque and closest approach of trajectories, as they are run."""
    plant = Plant(run.cell.whole_arm, run.cfg.plant)
    family, times = slowed.family, slowed.family.times(plant.settings.rate)
    rows = []
    for c in slowed.library.coefficients.split(1):
        planned = family.roll_out(c, times)
        rows.append(_facts(run, planned, plant.follow(planned)))
    return pd.DataFrame(rows, index=pd.RangeIndex(1, len(rows) + 1, name="trajectory"))


def _facts(run: RunContext, planned: Motion, executed: Executed) -> dict[str, str]:
    """Facts about one execution."""
    error = (executed.position - planned.position[0]).abs()
    worst, joint = error.amax(0).max(0)
    share = (executed.torque.abs() / run.cell.whole_arm.torque_limit).amax(0)
    stride = max(1, round(_EVERY * run.cfg.plant.rate))
    nearest = float(run.cell.constraints.nearest(executed.position[::stride])[0].min())
    return {
        "tracking error [rad]": f"{float(worst):.2g} ({run.cell.arm.joint_names[int(joint)]})",
        "largest torque": f"{float(share.max()):.0%} ({run.cell.arm.joint_names[int(share.argmax())]})",
        "closest [m]": f"{nearest:.3f}" if math.isfinite(nearest) else "—",
    }
