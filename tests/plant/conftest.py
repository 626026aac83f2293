from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.plant import PlantSettings
from sidegan.robot import Arm
from tests.chains import random_chain, real_links


@pytest.fixture(scope="session")
def chain() -> Callable[..., Arm]:
    """A random chain whose links can exist."""

    def make(joints: int, seed: int) -> Arm:
        return replace(random_chain(joints, seed)[0], inertial_parameters=real_links(joints, seed))

    return make


@pytest.fixture(scope="session")
def standard() -> PlantSettings:
    """The usual friction, drives and servos."""
    return PlantSettings()


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
