import json
from dataclasses import asdict, replace

import pytest
import torch

from sidegan.base.typed import build
from sidegan.conditional import Condition
from sidegan.conditional.settings import KINDS, Obstacles, Ranges, Request
from sidegan.errors import ConfigError, ShapeError
from tests.conditional.conftest import NOTHING, RANGES


def test_rows_are_taken_repeated_and_put_together(conditions):
    whole = Condition.cat([conditions.row(k) for k in range(len(conditions))])
    for name, x in conditions.columns().items():
        torch.testing.assert_close(getattr(whole, name), x)
        torch.testing.assert_close(getattr(conditions.repeat(3), name)[1::3], x)
    assert len(conditions.take(conditions.period > 8)) == int((conditions.period > 8).sum())


def test_a_condition_is_described_in_plain_values(space):
    plain = space.condition(Request(period=12, plane=0.2)).describe()
    assert plain["period"] == 12 and plain["plane"] == 0.2 and plain["home"] == [0, 0]
    assert json.loads(json.dumps(plain)) == plain


@pytest.mark.parametrize(
    "change", [{"period": torch.ones(3)}, {"walls": torch.ones(12)}, {"home": torch.ones(2)}]
)
def test_columns_that_do_not_fit_are_refused(conditions, change):
    with pytest.raises(ShapeError, match="of a condition is"):
        replace(conditions, **change)


def test_ranges_survive_a_file():
    assert build(Ranges, json.loads(json.dumps(asdict(RANGES)))) == RANGES


def test_what_has_no_range_cannot_be_requested():
    assert RANGES.kinds == KINDS
    assert list(RANGES.cases) == ["none", *KINDS, "all"]
    assert replace(RANGES, **NOTHING).kinds == ()
    assert replace(RANGES, **NOTHING).cases == {"none": ()}


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"velocity": [0.9, 0.5]}, "velocity is"),
        ({"velocity": [0.0, 1.0]}, "above 0"),
        ({"torque": [0.5, 1.2]}, "up to 1"),
        ({"period": [-1.0, 3.0]}, "period is"),
        ({"walls": [0.0, 1.0]}, "walls is"),
        ({"home": -0.1}, "home is -0.1"),
        ({"clearance": -0.1}, "clearance is -0.1"),
        ({"active": 0.0}, "active is"),
    ],
)
def test_impossible_ranges_are_refused(values, words):
    plain = json.loads(json.dumps(asdict(RANGES)))
    with pytest.raises(ConfigError, match=words):
        build(Ranges, {**plain, **values})


def test_impossible_obstacles_are_refused():
    with pytest.raises(ConfigError, match=r"obstacle\.half"):
        Obstacles((0, 0, 0), (1, 1, 1), (0.0, 0.1))
    with pytest.raises(ConfigError, match="lies above"):
        Obstacles((0, 2, 0), (1, 1, 1), (0.1, 0.1))
