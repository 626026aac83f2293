"""A trajectory rolled out in time, its torques, and the regressor that is linear in the base parameters."""

import torch

from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot

arm = load_robot("kuka_lwr4")  # or the path of a URDF
family = Trajectory(arm.joints, harmonics=6, period=16.0)  # cyclic, at rest at home at both ends
c = 0.1 * torch.randn(1, *family.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
motion = family.roll_out(c, family.times(rate=50))  # position, velocity, acceleration, (1, T, 7) each

body = RigidBody(arm)
states = [x[0] for x in (motion.position, motion.velocity, motion.acceleration)]
torque = body.torque(*states)  # [N·m], (T, 7)
regressor = body.base_regressor(*states)  # (T, 7, p)
difference = torque - regressor @ body.base.values
print(f"largest torque {torque.abs().max():.1f} N·m, {len(body.base.values)} base parameters")
print(f"largest difference from regressor · parameters {difference.abs().max():.0e} N·m")
