"""A trajectory rolled out in time, its torques, and the regressor that is linear in the base parameters."""

import numpy as np

import sidegan as sg

cell = sg.Cell("kuka_lwr4")  # or the path of a URDF
c = 0.1 * np.random.default_rng(0).standard_normal((1, 7, 6, 2))
motion = sg.TrajectorySet.of(cell, c).motion(rate=50)  # position, velocity, acceleration, (1, T, 7) each

states = [x[0] for x in (motion.position, motion.velocity, motion.acceleration)]
torque = cell.torque(*states)  # [N·m], (T, 7)
base = cell.body.base
regressor = cell.body.base_regressor(*states)  # (T, 7, p)
difference = np.abs(torque - regressor @ base.values).max()
print(f"largest torque {np.abs(torque).max():.1f} N·m, {len(base.values)} base parameters")
print(f"largest difference from regressor · parameters {difference:.0e} N·m")
