"""Refusals of the room by their words."""

import re
from dataclasses import asdict, replace

import numpy as np
import pytest

from sidegan.base.typed import build
from sidegan.errors import ConfigError, InfeasibleError, ShapeError, SideganError
from sidegan.gan.settings import GeneratorSettings, Variant
from sidegan.gan.training import Run, random_trajectories, train
from sidegan.validity import Constraints, Plane
from tests.gan.conftest import NONE, REFRESH

PHYSICS, REWARD = {"samples": 9, "reserve": 0}, {"proportional": 1, "constant": 0}
FIT = asdict(replace(NONE, fitness=1))
FAST = {"generator": GeneratorSettings(learning_rate=1e38, warm_up=0, corrections=0)}
RANK = replace(NONE, rank=1.0)
EXACT = {"variant": "Exact", "exact": PHYSICS, "reward": REWARD, "weights": asdict(NONE)}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"variant": "Colour"}, "variant is 'Colour', expected one of Vanilla, Eigen, Diagonal, Predicting"),
        ({"variant": "no.such.Colour"}, "variant is 'no.such.Colour', which is no class: No module"),
        ({"variant": "os.path.join"}, "variant is 'os.path.join', which is no class: "),
        ({"variant": "pathlib.Path"}, "variant is 'pathlib.Path', expected a subclass of one of Vanilla"),
        ({"weights": FIT}, "Vanilla has no such loss: weights.fitness must be 0"),
        ({"generator": {"betas": [0.5, 1]}}, "generator.betas[1] is 1, expected a number < 1"),
        ({"generator": {"batch": 1}}, "generator.batch is 1, expected a whole number ≥ 2"),
        ({"variant": "Eigen", "weights": FIT, "fitness_start": 9, "epochs": 9}, "after the last of 9 ep"),
        ({**EXACT, "reward": None}, "Exact needs settings reward"),
        ({**EXACT, "reward": {**REWARD, "proportional": 0}}, "are 0, expected one of them above it"),
        ({"reward": REWARD}, "Vanilla has no settings reward"),
        ({"variant": "Predicting"}, "Predicting needs settings reward"),
        ({**EXACT, "exact": None}, "Exact needs settings exact"),
        ({"exact": PHYSICS}, "Vanilla has no settings exact"),
        ({"published": {"fitness": "ratio"}}, "Vanilla has no settings published"),
        ({"refresh": asdict(REFRESH)}, "Vanilla has no surrogates to refresh"),
        ({"variant": "PublishedEigen"}, "PublishedEigen needs settings published"),
        ({"weights": asdict(NONE)}, "no loss has a weight in the first epoch"),
        ({"variant": "Eigen", "weights": FIT, "fitness_start": 1}, "no loss has a weight in the first epoch"),
    ],
)
def test_impossible_variants_are_refused(vanilla, settings, words):
    with pytest.raises(ConfigError) as error:
        build(Variant, {**asdict(vanilla), **settings})
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"variant": "Colour"}, "variant is 'Colour', expected one of Vanilla, "),
        ({"weights": {"rank": 1}}, "weights are {'rank': 1}, expected Weights"),
        ({"weights": NONE}, "no loss has a weight"),
    ],
)
def test_a_variant_made_in_python_is_refused_alike(vanilla, settings, words):
    with pytest.raises(ConfigError, match=re.escape(words)):
        replace(vanilla, **settings)


@pytest.mark.parametrize(
    ("error", "words", "change", "spoil"),
    [
        (ShapeError, "coefficients are", {}, lambda seeds: seeds[:, :1]),
        (ShapeError, "not finite", {}, lambda seeds: seeds * np.nan),
        (ShapeError, "scaling needs at least two seeds", {}, lambda seeds: seeds[:1]),
        (ConfigError, "all 64 seeds are the same", {}, lambda seeds: seeds[:1].repeat(64, 0)),
        (SideganError, "small diverged in epoch 0: .*smaller", FAST, lambda seeds: seeds),
        (SideganError, "its trajectories are not finite", {**FAST, "weights": RANK}, lambda seeds: seeds),
        (ConfigError, "small needs a success predictor", {"variant": "Eigen"}, lambda seeds: seeds),
    ],
)
def test_impossible_trainings_are_refused(vanilla, data, error, words, change, spoil, tmp_path):
    with pytest.raises(error, match=words):
        train(replace(vanilla, **change), replace(data, seeds=spoil(data.seeds)), Run("small", 0, tmp_path))


def test_an_arm_that_cannot_move_is_refused(planar, family):
    weak = Constraints(replace(planar, torque_limit=np.full(2, 1e-4)))
    beside = [Plane((side, 0, 0), -0.0501) for side in (1, -1)]  # a tenth of a millimetre from the links
    for constraints, fault in ((weak, "torque"), (Constraints(planar, beside), "keep_out")):
        with pytest.raises(InfeasibleError, match=f"a little .* violate {fault} of"):
            random_trajectories(constraints, family, 0)
