"""What trajectories are worth, by laws that copies, offsets and sizes cannot fool."""

import numpy as np
import pytest
import torch

from sidegan.design.prediction import random_motions
from sidegan.design.problem import Problem
from sidegan.gan.metrics import noises
from sidegan.gan.reward import Energies, Worth
from sidegan.gan.settings import Reward
from sidegan.gan.tensors import tensor
from tests.gan.conftest import random


@pytest.fixture(scope="module")
def problem(constraints, family):
    return Problem(constraints, family, 24)


@pytest.fixture(params=["proportional", "constant"])
def worth(request, problem):
    return Worth(problem, noises(problem.body)[request.param])


def test_the_mean_trajectory_is_worth_one(worth, problem):
    c = tensor(random_motions(problem, 8, seed=1))
    assert float(worth(c).exp().mean()) == pytest.approx(1, abs=1e-6)


def test_copies_are_worth_less_than_another(worth, problem):
    c = tensor(random_motions(problem, 9, seed=1))
    copied, others = c[:1].expand(8, -1, -1, -1), c[1:]
    for _ in range(3):
        worth(copied)
    assert worth(torch.cat([copied, others]))[8:].mean() > 0.5


def test_a_smaller_motion_is_worth_less(worth, problem):
    c = tensor(random_motions(problem, 8, seed=1))
    value = worth(torch.cat([c, 0.5 * c]))
    assert (value[8:] < value[:8]).all()


def test_the_worth_by_energies_has_the_exact_slope_at_the_seeds(constraints, family, seeds):
    """Where the mean energies are one, and the running means those of the seeds."""
    seeds = seeds[:64]
    told = Energies(constraints, family, seeds)
    energies = told(seeds)
    logs = tensor(energies).log()
    np.testing.assert_allclose(energies.mean(0), 1, rtol=0, atol=1e-6)
    for name, noise in noises(constraints.body).items():
        exact = Worth(told.problem, noise)
        exact.learn(seeds)
        shares = tensor(exact.slope[1])
        only = Reward(**{key: float(key == name) for key in told.parts})
        x = logs.clone().requires_grad_(True)
        (slope,) = torch.autograd.grad(told.worth(x, only), x)
        part = list(told.parts).index(name)
        own = slope.split(len(shares), 1)[part]
        energy = logs.split(len(shares), 1)[part].exp()
        expected = shares * energy / (energy @ shares)[:, None] / len(seeds)
        torch.testing.assert_close(own, expected, rtol=1e-6, atol=1e-9)


def test_a_direction_of_which_much_is_known_counts_less(constraints, family, seeds):
    told = Energies(constraints, family, seeds[:64])
    logs = torch.randn(32, told(seeds[:1]).shape[1], generator=random(), dtype=torch.float64)

    def slopes(x):
        x = x.clone().requires_grad_(True)
        (slope,) = torch.autograd.grad(told.worth(x, Reward(proportional=1.0, constant=1.0)), x)
        return slope.sum(0)

    known = logs.clone()
    known[:, 0] += 3
    assert slopes(known)[0] < slopes(logs)[0]
