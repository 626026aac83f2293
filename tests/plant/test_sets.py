"""Sets of trajectories, executed one by one."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.plant import IDEAL, Plant

FAMILY = Trajectory(2, 3, 1.0)


@pytest.fixture(scope="module")
def coefficients():
    return 0.2 * torch.randn(4, 2, 3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)


def test_each_trajectory_is_executed_with_its_own_noise(planar, standard, coefficients):
    same, plant = coefficients[:1].expand(2, -1, -1, -1), Plant(planar, standard)
    one, other = plant.sense_each(list(plant.follow_each(FAMILY, same)), np.random.SeedSequence(7))
    assert not torch.equal(one.torque, other.torque)
    motion = FAMILY.roll_out(coefficients[:1], FAMILY.times(standard.rate))
    alone = plant.execute(motion, np.random.SeedSequence(7).spawn(1)[0])
    torch.testing.assert_close(one.torque, alone.torque)


def test_recordings_come_in_the_order_of_the_trajectories(planar, coefficients):
    executed = list(Plant(planar, IDEAL).follow_each(FAMILY, coefficients))
    assert len(executed) == 4
    for one, c in zip(executed, coefficients):
        reference = FAMILY.roll_out(c[None], FAMILY.times(IDEAL.rate)).position[0]
        assert (one.position - reference).abs().max() < 1e-2


def test_a_trajectory_that_cannot_be_followed_is_an_error(planar, coefficients):
    plant = Plant(planar, replace(IDEAL, tolerance=1e-9))
    with pytest.raises(InfeasibleError, match="does not follow"):
        list(plant.follow_each(FAMILY, coefficients))


def test_coefficients_of_another_family_are_refused(planar, standard):
    with pytest.raises(ShapeError, match="expected"):
        list(Plant(planar, standard).follow_each(FAMILY, torch.zeros(1, 2, 4, 2)))
