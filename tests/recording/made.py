"""Recordings of random motions with a given friction."""

import math

import torch

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import Recording


def moved(arm, time, viscous, coulomb, generator, harmonics=5, period=10.0, noise=0.02):
    """A random periodic motion of an arm, which begins and ends anywhere, with noisy torque."""
    t = torch.as_tensor(time, dtype=torch.float64)[:, None, None]
    w = 2 * math.pi / period * torch.arange(1, harmonics + 1, dtype=torch.float64)
    draw = torch.randn(2, arm.joints, harmonics, generator=generator, dtype=torch.float64)
    size = 0.4 * draw[0].abs() / w.sqrt()
    phase = w * t + 3 * draw[1]
    q, v, a = (x.sum(2) for x in (size * phase.sin(), size * w * phase.cos(), -size * w**2 * phase.sin()))
    torque = RigidBody(arm).torque(q, v, a) + viscous * v + coulomb * torch.tanh(v / 0.03)
    error = noise * torque.std(0) * torch.randn(torque.shape, generator=generator, dtype=torch.float64)
    return Recording("made", arm.joint_names, t[:, 0, 0], q, velocity=v, torque=torque + error)
