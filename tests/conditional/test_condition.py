import json

import pytest
import torch

from sidegan.conditional import Condition
from sidegan.conditional.ranges import KINDS, Obstacles, Ranges
from sidegan.errors import ConfigError, ShapeError
from tests.conditional.conftest import RANGES


def test_rows_are_taken_repeated_and_put_together(conditions):
    whole = Condition.cat([conditions.row(k) for k in range(len(conditions))])
    for name, x in conditions.columns().items():
        torch.testing.assert_close(getattr(whole, name), x)
        torch.testing.assert_close(getattr(conditions.repeat(3), name)[1::3], x)
    assert len(conditions.take(conditions.period > 8)) == int((conditions.period > 8).sum())


def test_a_condition_can_be_told_in_plain_values(asking):
    told = asking.condition(period=12, plane=0.2).describe()
    assert told["period"] == 12 and told["plane"] == 0.2 and told["home"] == [0, 0]
    assert json.loads(json.dumps(told)) == told


@pytest.mark.parametrize(
    "change", [{"period": torch.ones(3)}, {"walls": torch.ones(12)}, {"home": torch.ones(2)}]
)
def test_columns_that_do_not_fit_are_refused(conditions, change):
    with pytest.raises(ShapeError, match="of a condition is"):
        conditions.changed(**change)


def test_ranges_survive_a_file():
    assert Ranges.of(json.loads(json.dumps(RANGES.describe()))) == RANGES
    assert RANGES.kinds == KINDS
    assert Ranges().kinds == ()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"velocity": (0.9, 0.5)}, "velocity is"),
        ({"velocity": (0.0, 1.0)}, "above 0"),
        ({"torque": (0.5, 1.2)}, "up to 1"),
        ({"period": (-1.0, 3.0)}, "period is"),
        ({"walls": (0.0, 1.0)}, "walls is"),
        ({"home": -0.1}, "nothing negative"),
        ({"active": 0.0}, "active is"),
    ],
)
def test_impossible_ranges_are_refused(values, words):
    with pytest.raises(ConfigError, match=words):
        Ranges(**values)


def test_impossible_obstacles_are_refused():
    with pytest.raises(ConfigError, match=r"obstacle\.half"):
        Obstacles((0, 0, 0), (1, 1, 1), (0.0, 0.1))
    with pytest.raises(ConfigError, match="lies above"):
        Obstacles((0, 2, 0), (1, 1, 1), (0.1, 0.1))
