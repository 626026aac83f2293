import numpy as np
import pytest
import torch

from sidegan.motion.trajectory import Motion
from tests.identification.recordings import noisy_rows


class LinearBody:
    """A made-up arm of three joints whose torques are linear in six parameters of unlike sizes."""

    joints, count, kinds = 3, 6, ("all",)
    names = tuple(f"p{i + 1}" for i in range(6))

    def __init__(self):
        self.values = torch.tensor([4.0, -0.3, 0.05, 1.2, -0.02, 0.4], dtype=torch.float64)
        self.largest = 0  # most samples that one call asked the regressor for

    def regressor(self, q, dq, ddq, sign=None):
        self.largest = max(self.largest, len(q))
        zero = torch.zeros_like(q[..., 0])
        rows = [
            [9.8 * q[..., 0].cos(), ddq[..., 0], dq[..., 1] ** 2, q[..., 1].sin(), ddq[..., 2], zero],
            [zero, 9.8 * q[..., 1].sin(), ddq[..., 1], dq[..., 0] * dq[..., 2], ddq[..., 0], zero],
            [zero, zero, 0.1 * ddq[..., 2], zero, 0.1 * q[..., 2].sin(), 0.1 * dq[..., 2]],
        ]
        return torch.stack([torch.stack(row, -1) for row in rows], -2)

    def torque(self, q, dq, ddq):
        return self.regressor(q, dq, ddq) @ self.values


@pytest.fixture
def body():
    return LinearBody()


@pytest.fixture
def motion():
    """Two trajectories of 150 samples, (2, 150, 3)."""
    random = np.random.default_rng(7)
    time = torch.linspace(0, 3, 150, dtype=torch.float64)
    speed, phase = torch.from_numpy(random.uniform(1, 5, (2, 2, 1, 3))).unbind()
    angle = speed * time[None, :, None] + phase
    return Motion(time, angle.sin(), speed * angle.cos(), -(speed**2) * angle.sin())


@pytest.fixture(scope="session")
def random_rows():
    """Regressor (200, 3, 6) and torque (200, 3) that no model fits exactly."""
    return noisy_rows(200)
