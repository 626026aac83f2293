"""Builders of the room: the planar arm's seeds, small surrogates and small variants."""

from dataclasses import replace
from pkgutil import resolve_name

import numpy as np
import pytest
import torch

from sidegan.base.typed import changed
from sidegan.design.problem import Problem
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.networks import DenseGenerator
from sidegan.gan.pretraining import SHARES, Labelled, Pretraining, load_surrogates
from sidegan.gan.scaling import Scaling
from sidegan.gan.settings import Refresh, Weights
from sidegan.gan.side_gan import Data
from sidegan.gan.training import TrainingRun, random_trajectories, train_variant
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check
from tests.tiny import tiny

STEPS = 32  # time points that the surrogates see
SMALL = {"epochs": 3, "steps": 2, "generator": {"batch": 32, "noise": 20, "width": 32, "corrections": 0}}
NONE = Weights()
FULL = Weights(adversarial=0.1, features=0.1, success=1, fitness=1, distance=1, rank=1, offset=1)
REFRESH = Refresh(samples=40, window=2, steps=5, learning_rate=1e-3)


def random(seed=0):
    return torch.Generator().manual_seed(seed)


def normal(family, seed=0, scale=1.0, count=8):
    """Single-precision coefficients, as a network yields them."""
    return scale * torch.randn(count, *family.shape, generator=random(seed))


def untrained(arm, family, start, limited=False, box=None, corrections=0):
    """A generator that starts as the Gaussian of some trajectories."""
    torch.manual_seed(0)
    start = torch.tensor(start)
    network, scaling = DenseGenerator(*family.shape[:2], 10, 16, True), Scaling.fit(start)
    network.start_from(scaling.image(start))
    return TrajectoryGenerator(
        network, scaling, family, arm, limited=limited, box=box, corrections=corrections
    ).eval()


@pytest.fixture(scope="session")
def family():
    return Trajectory(2, 3, 8.0)


@pytest.fixture(scope="session")
def constraints(planar):
    return Constraints(planar)


@pytest.fixture(scope="session")
def seeds(constraints, family):
    """Valid random trajectories that use most of their limits."""
    c = Problem(constraints, family).start(240, np.random.default_rng(0), 0.9)
    return c[check(constraints, family, c).valid]


@pytest.fixture(scope="session")
def wild(constraints, family):
    """Random trajectories of which most violate something."""
    return Problem(constraints, family).start(740, np.random.default_rng(1), 1.3)


@pytest.fixture(scope="session")
def pretrained(constraints, family, seeds, wild, tmp_path_factory):
    """Folder of small surrogates, the report of their trainings, and the last progress."""
    sizes = {"samples": 1200, "epochs": 40, "width": 64, "margin_steps": STEPS, "feature_steps": STEPS}
    folder, told = tmp_path_factory.mktemp("surrogates"), []
    made = Pretraining(constraints, family, replace(tiny().surrogates, **sizes), seeds, wild)
    labelled = Labelled.join(made.label(k, lambda *_: None) for k in range(SHARES))
    assert 0.15 < labelled.valid.mean() < 0.85  # or there would be nothing to learn
    report = made.train_success(labelled, folder, 0, lambda *step: told.append(step))
    for name in ("diagonal", "energies"):
        report |= made.train_features(name, labelled, folder, 0, lambda *_: None)
    return folder, report, told[-1]


@pytest.fixture(scope="session")
def vanilla():
    """A small vanilla GAN of few epochs."""
    return changed(tiny().gan["vanilla"], SMALL)


@pytest.fixture(scope="session")
def full():
    """A small variant with every loss."""
    return replace(changed(tiny().gan["diagonal"], SMALL), weights=FULL, refresh=REFRESH)


@pytest.fixture(scope="session")
def predicting():
    """A small variant that is rewarded for prediction by surrogates, and corrected."""
    made = tiny("gan=prediction").gan["prediction"]
    small = replace(changed(made, SMALL), weights=FULL, refresh=REFRESH)
    return changed(small, {"generator": {"corrections": 2}})


@pytest.fixture(scope="session")
def exact():
    """A small variant with exact physics."""
    made = tiny("gan=exact").gan["exact"]
    generator = {"batch": 64, "noise": 12, "width": 64, "learning_rate": 1e-3}
    physics = {"samples": 24, "reserve": 0.03}
    return changed(made, {"epochs": 3, "steps": 60, "generator": generator, "exact": physics})


@pytest.fixture(scope="session")
def data(constraints, family, seeds):
    return Data(constraints, family, seeds[:64])


@pytest.fixture(scope="session")
def taught(data, pretrained, full):
    """The same data with surrogates."""
    return with_surrogates(data, pretrained, full)


def with_surrogates(data, pretrained, variant):
    """Data with the surrogates that a variant learns from."""
    predictor, converter = load_surrogates(pretrained[0], variant, data.constraints.arm, data.trajectory)
    return replace(data, success_predictor=predictor, converter=converter)


@pytest.fixture(scope="session")
def trained(data):
    """Training of a variant in a folder."""

    def run(variant, work, seed=1, data=data, **options):
        if not variant.seeded:
            data = replace(data, seeds=random_trajectories(data.constraints, data.trajectory, seed))
        return train_variant(variant, data, TrainingRun("small", seed, work, **{"evaluation": 20, **options}))

    return run


@pytest.fixture(scope="session")
def made(taught, seeds):
    """An untrained variant, the same at every call."""

    def make(variant):
        torch.manual_seed(0)
        return resolve_name(variant._target_)(variant, replace(taught, seeds=seeds), "small")

    return make
