"""Sets of trajectories in worker processes."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.plant import IDEAL, Plant, execute_all

FAMILY = Trajectory(2, 3, 1.0)


@pytest.fixture(scope="module")
def coefficients():
    return 0.2 * torch.randn(4, 2, 3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)


def every_tenth(executed):
    return executed.torque[::10]


def test_results_do_not_depend_on_the_number_of_workers(planar, standard, coefficients):
    one, two = (
        execute_all(planar, standard, FAMILY, coefficients, np.random.SeedSequence(0), every_tenth, workers)
        for workers in (1, 2)
    )
    assert len(one) == 4
    assert all(torch.equal(a, b) for a, b in zip(one, two))


def test_each_trajectory_is_executed_with_its_own_noise(planar, standard, coefficients):
    random = np.random.SeedSequence(7)
    same = coefficients[:1].expand(2, -1, -1, -1)
    found = execute_all(planar, standard, FAMILY, same, random, every_tenth, 1)
    assert not torch.equal(*found)
    motion = FAMILY.roll_out(coefficients[:1], FAMILY.times(standard.rate))
    alone = Plant(planar, standard).execute(motion, np.random.SeedSequence(7).spawn(1)[0])
    assert torch.equal(found[0], alone.torque[::10])


def test_a_trajectory_that_cannot_be_followed_is_an_error(planar, coefficients):
    settings = replace(IDEAL, tolerance=1e-9)
    with pytest.raises(InfeasibleError, match="does not follow"):
        execute_all(planar, settings, FAMILY, coefficients, np.random.SeedSequence(0), every_tenth, 1)


def test_coefficients_of_another_family_are_refused(planar, standard):
    with pytest.raises(ShapeError, match="expected"):
        execute_all(planar, standard, FAMILY, torch.zeros(1, 2, 4, 2), np.random.SeedSequence(0), every_tenth)
