"""What the room refuses, by what the message has to name."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from sidegan.base.typed import build
from sidegan.errors import ConfigError, InfeasibleError, ShapeError, SideganError
from sidegan.gan.settings import GeneratorSettings, Variant, variant_recipe
from sidegan.gan.training import TrainingRun, random_trajectories, train_variant
from sidegan.validity import Constraints, Plane
from tests.gan.conftest import NONE, REFRESH
from tests.refusals import refused
from tests.tiny import tiny

PHYSICS, REWARD = {"samples": 9, "reserve": 0}, {"proportional": 1, "constant": 0}
FIT = asdict(replace(NONE, fitness=1))
FAST = {"generator": GeneratorSettings(learning_rate=1e38, warm_up=0, corrections=0)}
RANK = replace(NONE, rank=1.0)
CONVOLUTIONAL = {"network": "convolutional", "gaussian_start": False}
IMAGES = {"generator": GeneratorSettings(**CONVOLUTIONAL, corrections=0)}
EXACT = {
    "_target_": "sidegan.gan.variants.Exact",
    "exact": PHYSICS,
    "reward": REWARD,
    "weights": asdict(NONE),
}


def named(name: str) -> dict[str, str]:
    return {"_target_": f"sidegan.gan.variants.{name}"}


@pytest.mark.parametrize(
    ("settings", "names"),
    [
        (named("Colour"), ["_target_", "Colour", "Vanilla"]),
        ({"_target_": "no.such.Colour"}, ["_target_", "no.such.Colour", "No module"]),
        ({"_target_": "os.path.join"}, ["_target_", "os.path.join"]),
        ({"_target_": "pathlib.Path"}, ["_target_", "pathlib.Path", "Vanilla"]),
        ({"weights": FIT}, ["Vanilla", "weights.fitness"]),
        ({"generator": {"betas": [0.5, 1]}}, ["generator.betas[1]"]),
        ({"generator": {"batch": 1}}, ["generator.batch", "≥ 2"]),
        (
            {**named("Eigen"), "weights": FIT, "fitness_start": 9, "epochs": 9},
            ["fitness_start 9", "9 epochs"],
        ),
        ({**EXACT, "reward": None}, ["Exact", "reward"]),
        ({**EXACT, "reward": {**REWARD, "proportional": 0}}, ["reward: proportional", "constant"]),
        ({"reward": REWARD}, ["Vanilla", "reward"]),
        (named("Predicting"), ["Predicting", "reward"]),
        ({**EXACT, "exact": None}, ["Exact", "settings exact"]),
        ({"exact": PHYSICS}, ["Vanilla", "exact"]),
        ({"published": {"fitness": "ratio"}}, ["Vanilla", "published"]),
        ({"refresh": asdict(REFRESH)}, ["Vanilla", "refresh", "None"]),
        (named("PublishedEigen"), ["PublishedEigen", "settings published"]),
        (
            {**named("PublishedEigen"), "published": {"fitness": "ratio"}, "refresh": asdict(REFRESH)},
            ["PublishedEigen", "refresh"],
        ),
        ({"generator": {"network": "convolutional"}}, ["convolutional", "gaussian_start"]),
        ({"generator": CONVOLUTIONAL}, ["convolutional", "corrections"]),
        ({"weights": asdict(NONE)}, ["weights"]),
        ({**named("Eigen"), "weights": FIT, "fitness_start": 1}, ["weights", "first epoch"]),
    ],
)
def test_impossible_variants_are_refused(vanilla, settings, names):
    with refused(ConfigError, *names):
        build(Variant, {**asdict(vanilla), **settings})


def test_a_choice_of_several_variants_is_no_variant():
    with refused(ConfigError, "'paper'", "gan=paper is vanilla, eigen, diagonal"):
        variant_recipe("paper")


@pytest.mark.parametrize("recipe", [(), ("condition=published", "seeds.folder=none")])
def test_surrogates_cannot_learn_from_a_variant_that_needs_them(recipe):
    with refused(ConfigError, "surrogates.negatives", "eigen"):
        tiny(*recipe, "gan@surrogates.negatives=eigen")


@pytest.mark.parametrize("settings", [named("Colour"), {"weights": {"rank": 1}}, {"weights": NONE}])
def test_a_variant_made_in_python_is_refused_alike(vanilla, settings):
    with refused(ConfigError, *settings):
        replace(vanilla, **settings)


@pytest.mark.parametrize(
    ("error", "about", "change", "spoil"),
    [
        (ShapeError, ["(64, 1, 3, 2)"], {}, lambda seeds: seeds[:, :1]),
        (ShapeError, ["finite"], {}, lambda seeds: seeds * np.nan),
        (ShapeError, ["two seeds", "1"], {}, lambda seeds: seeds[:1]),
        (ConfigError, ["64 seeds"], {}, lambda seeds: seeds[:1].repeat(64, 0)),
        (SideganError, ["small", "epoch 0", "loss"], FAST, lambda seeds: seeds),
        (SideganError, ["small", "trajectories"], {**FAST, "weights": RANK}, lambda seeds: seeds),
        (ConfigError, ["small", "success"], named("Eigen"), lambda seeds: seeds),
        (ConfigError, ["small", "7 joints", "6 harmonics"], IMAGES, lambda seeds: seeds),
    ],
)
def test_impossible_trainings_are_refused(vanilla, data, error, about, change, spoil, tmp_path):
    with refused(error, *about):
        train_variant(
            replace(vanilla, **change),
            replace(data, seeds=spoil(data.seeds)),
            TrainingRun("small", 0, tmp_path),
        )


def test_an_arm_that_cannot_move_is_refused(planar, family):
    weak = Constraints(replace(planar, torque_limit=np.full(2, 1e-4)))
    beside = [Plane((side, 0, 0), -0.0501) for side in (1, -1)]  # a tenth of a millimetre from the links
    for constraints, fault in ((weak, "torque"), (Constraints(planar, beside), "keep_out")):
        with refused(InfeasibleError, fault):
            random_trajectories(constraints, family, 0)
