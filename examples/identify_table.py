"""An arm identified from a table of measured positions and torques: ``python identify_table.py log.csv``."""

import sys

import numpy as np
import pandas as pd

import sidegan as sg

cell = sg.Cell("planar2", harmonics=4, period=8)


def simulated() -> pd.DataFrame:
    """A table as one might log it: a random motion, friction, and noisy torques."""
    random = np.random.default_rng(0)
    table = sg.TrajectorySet.of(cell, 0.5 * random.standard_normal((1, 2, 4, 2))).to_frame(rate=100)
    q, dq, ddq = (table.filter(regex=rf"^{kind}_").to_numpy() for kind in ("q", "dq", "ddq"))
    torque = cell.torque(q, dq, ddq) + 2 * dq + random.normal(0, 0.2, q.shape)
    measured = {f"tau_{name}": x for name, x in zip(cell.arm.joint_names, torque.T)}
    return table[["time", *table.filter(regex="^q_")]].assign(**measured)


recording = sys.argv[1] if len(sys.argv) > 1 else simulated()
arm = sg.identify(cell, [recording], validation=0.25)
print(f"{arm.verdict}: {'; '.join(arm.reasons)}")
print(arm.parameters[["name", "value", "std", "urdf"]].to_string(index=False))
print("nMSE of what was held out:", arm.errors["nMSE, validation"].round(5).to_dict())
