from dataclasses import replace

import pytest
import torch

from sidegan.design.problem import Problem
from sidegan.gan.labels import blend, label
from sidegan.gan.pretrain import split, train_converter, train_predictor
from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.gan.variants import Weights
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check
from tests.tiny import tiny

STEPS = 32  # time points that the surrogates see
NONE = Weights(adversarial=0, features=0, success=0, fitness=0, spread=0, distance=0, rank=0)
ADVERSARIAL = replace(NONE, adversarial=1)
FULL = Weights(adversarial=0.1, features=0.1, success=1, fitness=1, spread=1, distance=1, rank=0)


def random(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="session")
def family():
    return Trajectory(2, 3, 8.0)


@pytest.fixture(scope="session")
def constraints(planar):
    return Constraints(planar)


@pytest.fixture(scope="session")
def seeds(constraints, family):
    """Valid random trajectories that use most of their limits."""
    c = Problem(constraints, family).start(240, random(), 0.9)
    return c[check(constraints, family, c).valid]


@pytest.fixture(scope="session")
def wild(constraints, family):
    """Random trajectories of which most violate something."""
    return Problem(constraints, family).start(240, random(1), 1.3)


@pytest.fixture(scope="session")
def labelled(constraints, family, seeds, wild):
    """Training and held-out samples."""
    c = blend(1.15 * seeds, wild, 2400, random(2))
    return split(label(constraints, family, c, STEPS), random(3))


@pytest.fixture(scope="session")
def predictor(planar, family, constraints, labelled):
    torch.manual_seed(0)
    made = SuccessPredictor(planar, family, len(constraints.labels), 64, STEPS)
    train_predictor(made, labelled[0], 12, random(4))
    return made


@pytest.fixture(scope="session")
def converter(planar, family, labelled):
    torch.manual_seed(0)
    diagonal = labelled[0].diagonal
    made = Converter(planar, family, diagonal.shape[1], 64, STEPS)
    train_converter(made, labelled[0].c, diagonal, 20, random(5))
    return made


@pytest.fixture(scope="session")
def vanilla():
    """A small vanilla GAN of few epochs."""
    sizes = {"epochs": 3, "steps": 2, "batch": 32, "noise": 20, "width": 32}
    return replace(tiny().gan["vanilla"], weights=ADVERSARIAL, learning_rate=1e-3, **sizes)


@pytest.fixture(scope="session")
def full(vanilla):
    """A small variant with every loss."""
    return replace(vanilla, features="diagonal", weights=FULL, fitness_start=1)
