"""Whether trajectories of one's own are valid: limits, self-collision and regions, proven between samples."""

import numpy as np

import sidegan as sg

ball = {"sphere": {"centre": [0.5, 0.0, 0.8], "radius": 0.15}}
cell = sg.Cell("kuka_lwr4", harmonics=2, period=10, workspace={"regions": [ball]}, clearance=0.0, effort=1.0)

c = np.zeros((3, 7, 2, 2))  # of joint, harmonic, and sine or cosine [rad/s]
c[1, 1, 0] = [0.0, 0.5]  # the second joint leans a little
c[2, 1, 0] = [0.0, 2.0]  # and much

verdict = cell.check(c)
for k, valid in enumerate(verdict.valid.tolist()):
    print(f"trajectory {k}: {'valid' if valid else '; '.join(map(str, verdict.failures(k)))}")
