from collections.abc import Callable

import numpy as np
import pytest

from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.robot import Arm


@pytest.fixture(scope="session")
def motions() -> Callable[..., Motion]:
    """Lively random motions (count, T, J) of an arm."""

    def make(arm: Arm, count: int = 1, period: float = 4.0, rate: float = 1000.0, seed: int = 0) -> Motion:
        home = ((arm.position_lower + arm.position_upper) / 2).tolist()
        trajectory = Trajectory(arm.joints, 3, period, home)
        random = np.random.default_rng(seed)
        c = random.standard_normal((count, arm.joints, 3, 2))
        return trajectory.roll_out(0.1 * arm.velocity_limit[:, None, None] * c, trajectory.times(rate))

    return make
