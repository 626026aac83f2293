"""The basis at single times against that of the trajectory, which solves for its quintics."""

import numpy as np
import pytest
import torch

from sidegan.motion.trajectory import Trajectory


@pytest.mark.parametrize("order", range(5))
@pytest.mark.parametrize("harmonics", [1, 7, 40])
def test_each_derivative_is_that_of_a_trajectory_of_one_second(harmonics, order):
    from sidegan.kernels.waves import waves

    shares = np.concatenate([np.linspace(0.0, 1.0, 33), np.random.default_rng(0).random(20)])
    found = np.full((len(shares), order + 1, 2 * harmonics), np.nan)
    waves(shares, found)
    expected = Trajectory(1, harmonics, 1.0).basis(torch.from_numpy(shares), order).flatten(1).numpy()
    scale = np.abs(expected).max(0)
    assert (np.abs(found[:, order] - expected) <= 1e-11 * scale).all()
