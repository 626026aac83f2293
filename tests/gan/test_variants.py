import pytest

from sidegan.errors import ConfigError
from sidegan.gan.variants import Variant, Weights


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"features": "colour"}, "features 'colour' of x must be one of none, spectrum, diagonal"),
        ({"body": "vit"}, "body 'vit' of x must be one of conv, mlp"),
        ({"weights": Weights(features=1)}, "x weighs features or fitness but predicts none"),
        ({"weights": Weights(fitness=1)}, "x weighs features or fitness but predicts none"),
        ({"epochs": 0}, "epochs of x must be positive, got 0"),
        ({"noise": -1}, "noise of x must be positive, got -1"),
        ({"width": 0}, "width of x must be positive"),
        ({"generator_steps": 0}, "generator_steps of x must be positive"),
        ({"batch": 1}, "batch of x must be at least 2, got 1"),
        (
            {"features": "spectrum", "weights": Weights(fitness=1), "epochs": 10, "fitness_start": 10},
            "fitness_start 10 of x comes after its last epoch 9",
        ),
    ],
)
def test_impossible_combinations_are_refused_by_name(settings, expected):
    with pytest.raises(ConfigError) as error:
        Variant("x", **settings)
    assert expected in str(error.value)


def test_only_what_is_weighed_or_seen_needs_surrogates():
    assert not Variant("vanilla", weights=Weights(spread=1, distance=1)).surrogates
    assert Variant("valid", weights=Weights(success=1)).surrogates
    assert Variant("eigen", features="spectrum").surrogates
