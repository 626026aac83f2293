"""A long recording of the LWR in a file."""

import numpy as np
import pandas as pd
import torch

from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

PERIOD, RATE = 16.0, 1000  # [s], [Hz]
NOISE = {"q": 1e-5, "qd": 1e-3, "tau": 0.1}  # standard deviations


def write(arm, path, periods):
    """Write a recording of the arm, period after period with fresh noise; its number of samples."""
    generator = torch.Generator().manual_seed(0)
    c = 0.06 * torch.randn(1, arm.joints, 6, 2, generator=generator, dtype=torch.float64)
    clock = np.arange(int(PERIOD * RATE)) / RATE
    motion = Trajectory(arm.joints, 6, PERIOD).roll_out(c, torch.from_numpy(clock))
    q, v, a = (x[0] for x in motion[1:])
    signals = {"q": q, "qd": v, "tau": RigidBody(arm).torque(q, v, a) + 2 * v + torch.tanh(v / 0.03)}
    columns, noise = {"t": np.arange(periods * len(clock)) / RATE}, np.random.default_rng(0)
    for name, x in signals.items():
        noisy = np.tile(x, (periods, 1))
        noisy += NOISE[name] * noise.standard_normal(noisy.shape)
        columns |= {f"{name}{j + 1}": noisy[:, j] for j in range(arm.joints)}
    pd.DataFrame(columns).to_parquet(path, row_group_size=len(clock), index=False)
    return len(columns["t"])
