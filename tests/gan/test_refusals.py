"""What the room refuses, and in which words."""

from dataclasses import asdict, replace
from types import SimpleNamespace

import pytest
import torch

from sidegan.base.typed import build
from sidegan.design.objectives import Term
from sidegan.errors import ArtifactError, ConfigError, InfeasibleError, ShapeError, SideganError
from sidegan.gan import TrajectoryGenerator, jobs
from sidegan.gan.limits import LimitLayer
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.training import Run, train_variant
from sidegan.gan.variants import Variant
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane
from tests.gan.conftest import ADVERSARIAL, NONE, untrained

FITNESS = asdict(replace(NONE, fitness=1))
SINGLE = asdict(Term("log_condition", 1.0, 1))
PHYSICS = {"terms": {"single": SINGLE}, "samples": 9, "reserve": 0, "ease": 1}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"features": "colour"}, "features is 'colour', expected 'none', 'spectrum' or 'diagonal'"),
        ({"weights": asdict(replace(NONE, features=1))}, "weights.fitness need features, which are none"),
        ({"epochs": 0}, "epochs is 0"),
        ({"betas": [0.5, 1]}, "must be less than 1"),
        ({"batch": 1}, "batch is 1, expected a whole number ≥ 2"),
        (
            {"features": "spectrum", "weights": FITNESS, "epochs": 10, "fitness_start": 10},
            "fitness_start 10 comes after the last of 10 epochs",
        ),
        ({"exact": {**PHYSICS, "terms": {}}}, "terms is empty, expected one objective"),
        ({"exact": {**PHYSICS, "ease": 0}}, "exact.ease is 0"),
        ({"exact": PHYSICS}, "exact physics has no discriminators"),
        ({"exact": PHYSICS, "weights": FITNESS, "features": "spectrum"}, "exact physics has no discrim"),
        (
            {"exact": {**PHYSICS, "terms": {"set": {**SINGLE, "together": 99}}}, "weights": FITNESS},
            "objective is of 99 trajectories together, batch is 32",
        ),
    ],
)
def test_impossible_variants(vanilla, settings, words):
    with pytest.raises(ConfigError) as error:
        build(Variant, {**asdict(vanilla), "betas": [0, 0.9], **settings})
    assert words in str(error.value)


@pytest.fixture(scope="module")
def room(arm, planar, family, constraints, seeds, vanilla, exact, assembled, tmp_path_factory):
    """What the calls of the table are made of."""
    folder = tmp_path_factory.mktemp("refusals")
    torch.save({"sizes": {"width": 8, "margin_steps": 8}, "names": 3, "weights": {}}, folder / "success.pt")
    generator = untrained(planar, family, seeds)
    generator.save(folder / "g.pt")
    weak = Constraints(replace(planar, torque_limit=torch.full((2,), 1e-4, dtype=torch.float64)))
    beside = [Plane((side, 0, 0), -0.0501) for side in (1, -1)]  # a tenth of a millimetre from the links
    walled = Constraints(planar, beside)
    needy = replace(vanilla, weights=replace(ADVERSARIAL, success=1))
    seeing, fast = replace(vanilla, features="spectrum"), replace(vanilla, learning_rate=1e38)

    def train(variant, given, within=constraints):
        return train_variant(variant, within, family, given, Run("small", 0, folder / "work"))

    def load(name, arm=None):
        return TrajectoryGenerator.load(folder / name, arm)

    def limits(room, speed, **inverse):
        return LimitLayer(family, torch.full(room, 1.0), torch.ones(speed), inverse)

    def surrogates(variant):
        return jobs.load_surrogates(folder, variant, planar, family)

    return SimpleNamespace(**locals())


REFUSALS = {
    "cannot sample 0 trajectories": (ShapeError, lambda r: r.generator.sample(0)),
    "cannot sample -3 trajectories": (ShapeError, lambda r: r.generator.sample(-3)),
    "there is no file": (ArtifactError, lambda r: r.load("none.pt")),
    "planar2 .* not for kuka_lwr4": (ArtifactError, lambda r: r.load("g.pt", r.arm)),
    r"there is no file .*spectrum\.pt": (ArtifactError, lambda r: r.surrogates(r.seeing)),
    "a surrogate in .* does not fit this arm": (ArtifactError, lambda r: r.surrogates(r.needy)),
    "3 joints for an arm of 2": (ShapeError, lambda r: LimitLayer.of(r.planar, Trajectory(3))),
    r"room \(2, 3\) and speed \(2,\)": (ShapeError, lambda r: r.limits((2, 3), 2)),
    r"expected \(2, 2\) and \(2,\)": (ShapeError, lambda r: r.limits((2, 2), 2, jerk=torch.ones(3))),
    "all positive": (ShapeError, lambda r: LimitLayer(r.family, torch.zeros(2, 2), torch.ones(2))),
    "scaling needs at least two seeds": (ShapeError, lambda r: Scaling.fit(torch.zeros(1, 2, 3, 2))),
    "without a shortcut": (ConfigError, lambda r: Generator(2, 3).start_from(torch.randn(9, 2, 2, 3))),
    "small learns from a seed set, got none": (ShapeError, lambda r: r.train(r.vanilla, None)),
    "training needs at least two seeds": (ShapeError, lambda r: r.train(r.vanilla, r.seeds[:1])),
    "coefficients are": (ShapeError, lambda r: r.train(r.vanilla, r.seeds[:, :1])),
    "not finite": (ShapeError, lambda r: r.train(r.vanilla, r.seeds * torch.nan)),
    "small diverged in epoch 0": (SideganError, lambda r: r.train(r.fast, r.seeds)),
    "a little .* violate torque of": (InfeasibleError, lambda r: r.train(r.exact, None, r.weak)),
    "a little .* violate keep_out of": (InfeasibleError, lambda r: r.train(r.exact, None, r.walled)),
    "small needs a predictor": (ConfigError, lambda r: r.assembled(r.needy)),
    "small needs a converter to spectrum": (ConfigError, lambda r: r.assembled(r.seeing)),
}


@pytest.mark.parametrize("words", REFUSALS)
def test_refusals(room, words):
    error, call = REFUSALS[words]
    with pytest.raises(error, match=words):
        call(room)
