from dataclasses import asdict, replace

import pytest

from sidegan.base.typed import build
from sidegan.design.objectives import Term
from sidegan.errors import ConfigError
from sidegan.gan.variants import Exact, Learned, Variant
from tests.gan.conftest import ADVERSARIAL, NONE

FITNESS = asdict(replace(NONE, fitness=1))


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"features": "colour"}, "features is 'colour', expected one of none, spectrum, diagonal"),
        ({"body": "vit"}, "body is 'vit', expected one of conv, mlp, dcgan"),
        ({"weights": asdict(replace(NONE, features=1))}, "weights.fitness need features, which are none"),
        ({"weights": FITNESS}, "weights.fitness need features, which are none"),
        ({"epochs": 0}, "epochs is 0"),
        ({"noise": -1}, "noise is -1"),
        ({"width": 0}, "width is 0"),
        ({"generator_steps": 0}, "generator_steps is 0"),
        (
            {"losses": {"adversarial": "lsgan"}},
            "losses.adversarial is 'lsgan', expected one of non_saturating",
        ),
        ({"surrogates": {"predictor": "none"}}, "surrogates.predictor is 'none', expected one of broad"),
        ({"betas": [0.5, 1]}, "must be less than 1"),
        ({"betas": [0.5]}, "betas is [0.5], expected a list of 2"),
        ({"average": 1.0}, "average 1.0 must be less than 1"),
        ({"body": "dcgan"}, "images in [−1, 1]: scaling must be range"),
        ({"body": "dcgan", "scaling": "range"}, "a dcgan has no gaussian_start, minibatch"),
        ({"batch": 1}, "batch is 1, expected a whole number ≥ 2"),
        (
            {"features": "spectrum", "weights": FITNESS, "epochs": 10, "fitness_start": 10},
            "fitness_start 10 comes after the last of 10 epochs",
        ),
        ({"exact": {"terms": {}, "samples": 9, "reserve": 0, "ease": 1}}, "terms is empty, expected one"),
        ({"exact": {"terms": {}, "samples": 9, "reserve": 0, "ease": 0}}, "exact.ease is 0"),
    ],
)
def test_impossible_settings_are_refused(vanilla, settings, expected):
    with pytest.raises(ConfigError) as error:
        build(Variant, {**asdict(vanilla), "betas": [0, 0.9], **settings})
    assert expected in str(error.value)


def test_an_objective_of_more_trajectories_than_a_batch_is_refused(vanilla):
    exact = Exact({"set": Term("d_optimal", 1.0, 100)}, samples=24, reserve=0.05, ease=0.1)
    with pytest.raises(ConfigError, match="objective is of 100 trajectories together, batch is 32"):
        replace(vanilla, exact=exact)


def test_only_what_is_weighed_or_seen_needs_surrogates(vanilla):
    assert not replace(vanilla, weights=replace(ADVERSARIAL, spread=1, distance=1)).learned
    assert replace(vanilla, weights=replace(ADVERSARIAL, success=1)).learned == {"predictor": "broad"}
    mixed = replace(vanilla, features="spectrum", surrogates=Learned(predictor="broad", converter="paper"))
    assert mixed.learned == {"converter": "paper"}
