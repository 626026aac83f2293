"""Refusals of the room by their words."""

from dataclasses import asdict, replace
from types import SimpleNamespace

import pytest
import torch

from sidegan.base.typed import build
from sidegan.design.objectives import Term
from sidegan.errors import ArtifactError, ConfigError, InfeasibleError, ShapeError, SideganError
from sidegan.gan import TrajectoryGenerator, Variant
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.training import Run, random_trajectories, train
from sidegan.validity import Constraints, Plane
from tests.gan.conftest import NONE, untrained
from tests.tiny import tiny

SINGLE = asdict(Term("log_condition", 1.0, 1))
PHYSICS = {"terms": {"single": SINGLE}, "samples": 9, "reserve": 0, "ease": 1}
FIT = asdict(replace(NONE, fitness=1))
EXACT = {"variant": "Exact", "exact": PHYSICS, "weights": asdict(NONE)}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"variant": "Colour"}, "variant is 'Colour', expected 'Vanilla', 'Eigen', 'Diagonal', 'Exact', 'P"),
        (
            {"weights": asdict(replace(NONE, features=1, success=1))},
            "weights.features, weights.success must be 0",
        ),
        ({**EXACT, "weights": asdict(replace(NONE, adversarial=1))}, "Exact has no such loss: weights.adver"),
        ({"epochs": 0}, "epochs is 0"),
        ({"betas": [0.5, 1]}, "must be less than 1"),
        ({"batch": 1}, "batch is 1, expected a whole number ≥ 2"),
        (
            {"variant": "Eigen", "weights": FIT, "fitness_start": 9, "epochs": 9},
            "comes after the last of 9 ep",
        ),
        (
            {**EXACT, "exact": {**PHYSICS, "terms": {}}},
            "exact.terms are of [] trajectories together, expected one",
        ),
        ({**EXACT, "exact": {**PHYSICS, "ease": 0}}, "exact.ease is 0"),
        ({**EXACT, "exact": None}, "Exact needs settings exact"),
        ({"exact": PHYSICS}, "Vanilla has no settings exact"),
        ({"published": {"fitness": "ratio"}}, "Vanilla has no settings published"),
        ({"variant": "PublishedVanilla"}, "PublishedVanilla needs settings published"),
        (
            {**EXACT, "exact": {**PHYSICS, "terms": {"set": {**SINGLE, "together": 99}}}},
            "none of more than batch=32",
        ),
    ],
)
def test_impossible_variants(vanilla, settings, words):
    with pytest.raises(ConfigError) as error:
        build(Variant, {**asdict(vanilla), "betas": [0, 0.9], **settings})
    assert words in str(error.value)


@pytest.mark.parametrize("name", ["vanilla", "eigen", "diagonal", "exact"])
def test_every_file_of_the_group_is_a_variant_of_its_name(name):
    assert tiny(f"gan={name}").gan[name].variant == name.capitalize()


@pytest.fixture(scope="module")
def room(arm, planar, family, constraints, seeds, vanilla, full, data, tmp_path_factory):
    """Arguments of the calls below."""
    folder = tmp_path_factory.mktemp("refusals")
    generator = untrained(planar, family, seeds)
    generator.save(folder / "g.pt")
    weak = Constraints(replace(planar, torque_limit=torch.full((2,), 1e-4, dtype=torch.float64)))
    beside = [Plane((side, 0, 0), -0.0501) for side in (1, -1)]  # a tenth of a millimetre from the links
    walled, fast = Constraints(planar, beside), replace(vanilla, learning_rate=1e38)

    def trained(variant, given, within=constraints):
        return train(
            variant, replace(data, seeds=given, constraints=within), Run("small", 0, folder / "work")
        )

    def start(within):
        return random_trajectories(within, family, 0)

    def load(name, arm):
        return TrajectoryGenerator.load(folder / name, arm)

    return SimpleNamespace(**locals())


REFUSALS = {
    "cannot sample 0 trajectories": (ShapeError, lambda r: r.generator.sample(0)),
    "there is no file": (ArtifactError, lambda r: r.load("none.pt", r.arm)),
    "planar2 .* not for kuka_lwr4": (ArtifactError, lambda r: r.load("g.pt", r.arm)),
    "scaling needs at least two seeds": (ShapeError, lambda r: Scaling.fit(torch.zeros(1, 2, 3, 2))),
    "without a shortcut": (ConfigError, lambda r: Generator(2, 3).start_from(torch.randn(9, 2, 2, 3))),
    "coefficients are": (ShapeError, lambda r: r.trained(r.vanilla, r.seeds[:, :1])),
    "not finite": (ShapeError, lambda r: r.trained(r.vanilla, r.seeds * torch.nan)),
    "small diverged in epoch 0": (SideganError, lambda r: r.trained(r.fast, r.seeds)),
    "a little .* violate torque of": (InfeasibleError, lambda r: r.start(r.weak)),
    "a little .* violate keep_out of": (InfeasibleError, lambda r: r.start(r.walled)),
    "small needs a success predictor and a conv": (ConfigError, lambda r: r.trained(r.full, r.seeds)),
}


@pytest.mark.parametrize("words", REFUSALS)
def test_refusals(room, words):
    error, call = REFUSALS[words]
    with pytest.raises(error, match=words):
        call(room)
