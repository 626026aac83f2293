"""The set as an arm in MuJoCo executes it, under servos and with friction, before anything moves."""

import math

import numpy as np
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
    for c in slowed.coefficients:
        planned = family.roll_out(c[None], times)
        rows.append(_facts(run, planned, plant.follow(planned)))
    return pd.DataFrame(rows, index=pd.RangeIndex(1, len(rows) + 1, name="trajectory"))


def _facts(run: RunContext, planned: Motion, executed: Executed) -> dict[str, str]:
    """Facts about one execution."""
    error = np.abs(executed.position - planned.position[0]).max(0)
    share = (np.abs(executed.torque) / run.cell.whole_arm.torque_limit).max(0)
    stride = max(1, round(_EVERY * run.cfg.plant.rate))
    nearest = float(run.cell.constraints.nearest(executed.position[::stride])[0].min())
    return {
        "tracking error [rad]": f"{error.max():.2g} ({run.cell.arm.joint_names[error.argmax()]})",
        "largest torque": f"{share.max():.0%} ({run.cell.arm.joint_names[share.argmax()]})",
        "closest [m]": f"{nearest:.3f}" if math.isfinite(nearest) else "—",
    }
