"""Whether trajectories of one's own are valid: limits, self-collision and regions, proven between samples."""

import torch

from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane, Sphere, check

arm = load_robot("kuka_lwr4")
desk, ball = Plane(normal=(0, 0, 1), offset=0.10), Sphere(centre=(0.5, 0.0, 0.8), radius=0.15)
constraints = Constraints(arm, [desk, ball])

family = Trajectory(arm.joints, harmonics=2, period=10.0)
c = torch.zeros(3, *family.shape, dtype=torch.float64)  # of joint, harmonic, and sine or cosine [rad/s]
c[1, 1, 0] = torch.tensor([0.0, 0.5])  # the second joint leans a little
c[2, 1, 0] = torch.tensor([0.0, 2.0])  # and much

verdict = check(constraints, family, c)
for k, valid in enumerate(verdict.valid.tolist()):
    print(f"trajectory {k}: {'valid' if valid else '; '.join(map(str, verdict.failures(k)))}")
