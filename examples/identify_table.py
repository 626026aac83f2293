"""An arm identified from a table of measured states and torques: ``python identify_table.py table.csv``."""

import sys

import pandas as pd
import torch

from sidegan.identification import RIGID, Measurements, Noise, TorqueModel, estimate, measure, score
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot

arm = load_robot("planar2")
body = RigidBody(arm)
columns = {sign: [f"{sign}_{joint}" for joint in arm.joint_names] for sign in ("q", "dq", "ddq", "tau")}


def simulated() -> pd.DataFrame:
    """A table as one might log it, with noisy torques."""
    family = Trajectory(arm.joints, harmonics=4, period=8.0)
    c = 0.5 * torch.randn(2, *family.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    noise = Noise()
    samples = measure(body, family.roll_out(c, family.times(rate=100)), noise, 0)
    signals = zip(columns.values(), (*samples.states, samples.torque))
    return pd.concat([pd.DataFrame(x.numpy(), columns=names) for names, x in signals], axis=1)


table = pd.read_csv(sys.argv[1]) if len(sys.argv) > 1 else simulated()
samples = Measurements(*(torch.tensor(table[names].to_numpy(float)) for names in columns.values()))
half = len(samples) // 2

model = TorqueModel(body, RIGID)
found = estimate("weighted", model, samples[:half])
for name, value, deviation in zip(found.names, found.parameters.tolist(), found.deviation.tolist()):
    print(f"{name:>12} {value:9.4f} ± {deviation:.4f}")
errors = score(model, found.parameters, samples[half:]).nmse
print("nMSE of the other half:", ", ".join(f"{joint} {x:.2g}" for joint, x in zip(arm.joint_names, errors)))
