"""Builders of the room: the planar arm's seeds, small surrogates and small variants."""

from dataclasses import replace

import pytest
import torch

from sidegan.design.problem import Problem
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.labels import blend, label
from sidegan.gan.networks import Generator
from sidegan.gan.pretrain import split, train_converter, train_predictor
from sidegan.gan.scaling import Scaling
from sidegan.gan.surrogates import Converter, SuccessPredictor, Surrogates
from sidegan.gan.training import Run, assemble, train_variant
from sidegan.gan.variants import Weights
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check
from tests.tiny import tiny

STEPS = 32  # time points that the surrogates see
NONE = Weights(adversarial=0, features=0, success=0, fitness=0, distance=0, rank=0)
ADVERSARIAL = replace(NONE, adversarial=1)
FULL = Weights(adversarial=0.1, features=0.1, success=1, fitness=1, distance=1, rank=1)


def random(seed=0):
    return torch.Generator().manual_seed(seed)


def normal(family, seed=0, scale=1.0, count=8):
    """Single-precision coefficients, as a network yields them."""
    return scale * torch.randn(count, *family.shape, generator=random(seed))


def untrained(arm, family, start, limits=None):
    """A generator that starts as the Gaussian of some trajectories."""
    torch.manual_seed(0)
    network, scaling = Generator(*family.shape[:2], 10, 16, True), Scaling.fit(start)
    network.start_from(scaling.image(start))
    return TrajectoryGenerator(network.eval(), scaling, family, arm.name, arm.digest, "eigen", limits)


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
    c = blend(1.15 * seeds, wild, 1800, random(2))
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
    train_converter(made, labelled[0].c, diagonal, 40, random(5))
    return made


@pytest.fixture(scope="session")
def vanilla():
    """A small vanilla GAN of few epochs."""
    sizes = {"epochs": 3, "steps": 2, "batch": 32, "noise": 20, "width": 32}
    return replace(tiny().gan["vanilla"], weights=ADVERSARIAL, **sizes)


@pytest.fixture(scope="session")
def full(vanilla):
    """A small variant with every loss."""
    return replace(vanilla, features="diagonal", weights=FULL, fitness_start=1)


@pytest.fixture(scope="session")
def exact():
    """A small variant with exact physics."""
    made = tiny("gan=exact").gan["exact"]
    sizes = {"epochs": 3, "steps": 60, "batch": 64, "noise": 12, "width": 64}
    terms = {"single": made.exact.terms["single"]}
    physics = replace(made.exact, terms=terms, samples=24, reserve=0.03)
    weights = replace(made.weights, success=1000, rank=20)
    return replace(made, weights=weights, learning_rate=2e-3, exact=physics, **sizes)


@pytest.fixture(scope="session")
def train(constraints, family, seeds):
    """Training of a variant in a folder."""

    def run(variant, work, seed=1, surrogates=None, **options):
        given = seeds[:64] if variant.seeded else None
        once = Run("small", seed, work, **{"evaluation": 20, **options})
        return train_variant(variant, constraints, family, given, once, surrogates or Surrogates())

    return run


@pytest.fixture(scope="session")
def assembled(constraints, family, seeds, tmp_path_factory):
    """An untrained variant, the same at every call."""
    run = Run("small", 0, tmp_path_factory.mktemp("assembled"))

    def make(variant, *surrogates):
        torch.manual_seed(0)
        return assemble(variant, constraints, family, seeds, run, Surrogates(*surrogates))

    return make
