"""Settings are read by the types of their dataclass, and every mistake is named."""

import dataclasses
from types import MappingProxyType
from typing import Literal

import pytest

from sidegan.base.typed import (
    Count,
    Natural,
    NonNegative,
    Number,
    Positive,
    PositiveShare,
    Text,
    build,
    changed,
    settings_of,
)
from sidegan.errors import ConfigError
from tests.refusals import refused


@dataclasses.dataclass(frozen=True)
class Inner:
    count: Count
    kind: Literal["small", "large"]
    optional: Number | None = None

    def __post_init__(self):
        if self.kind == "small" and self.count > 10:
            raise ConfigError(f"a small one has at most 10, got {self.count}")


@dataclasses.dataclass(frozen=True)
class Outer:
    seed: Natural
    rate: Positive
    weight: NonNegative
    name: str
    on: bool
    corner: tuple[Number, Number]
    sizes: list[Count]
    inner: Inner
    many: dict[str, Inner]
    regions: list[Inner] | None
    words: dict[str, Text]
    files: list[str | Inner] | PositiveShare


GOOD = {"seed": 0, "rate": 100, "weight": 0.0, "name": "a", "on": True, "corner": [1, 2.5]}
GOOD |= {"sizes": [6, 210], "regions": None, "inner": {"count": 3, "kind": "small"}, "files": 0.5}
GOOD |= {"many": {"first": {"count": 30, "kind": "large", "optional": 2}}}
GOOD |= {"words": {"number": 0.2, "whole": 3, "truth": True, "text": "a b"}}


def test_every_kind_of_value_round_trips():
    outer = build(Outer, GOOD)
    assert outer.inner == Inner(3, "small") and outer.many == {"first": Inner(30, "large", 2.0)}
    assert outer.corner == (1.0, 2.5) and outer.sizes == [6, 210] and outer.regions is None
    assert isinstance(outer.rate, float), "a whole number is a number"
    assert list(outer.words.values()) == ["0.2", "3", "true", "a b"], "a text may be written as a number"
    assert outer.files == 0.5
    assert build(Outer, {**GOOD, "files": ["a", GOOD["inner"]]}).files == ["a", Inner(3, "small")]
    assert build(Outer, dataclasses.asdict(outer)) == outer


def test_a_change_of_a_group_keeps_its_other_settings():
    outer = build(Outer, GOOD)
    new = {"seed": 1, "inner": {"count": 4}, "many": {"first": {"count": 31}, "second": GOOD["inner"]}}
    made = changed(outer, new)
    assert (made.seed, made.rate, made.inner) == (1, outer.rate, Inner(4, "small"))
    assert made.many == {"first": Inner(31, "large", 2.0), "second": Inner(3, "small")}
    assert changed(outer, {"inner": Inner(4, "large")}).inner == Inner(4, "large")
    with refused(ConfigError, "inner.cuont", "inner.count"):
        changed(outer, {"inner": {"cuont": 3}})


MISSPELT = {"cuont": 3, "kind": "small"}  # one mistake, and not a missing setting too


WRONG = [  # a setting, its value, and what the message names
    ("seed", 1.0, "seed", "1.0"),
    ("seed", True, "seed", "True"),
    ("seed", -1, "seed", "-1", "0"),
    ("rate", 0, "rate", "1e-12"),
    ("rate", float("nan"), "rate", "nan"),
    ("weight", float("inf"), "weight", "inf", "1e+12"),
    ("name", 3, "name", "3"),
    ("on", 1, "on", "1"),
    ("corner", [1], "corner[1]"),
    ("corner", [1, "x"], "corner[1]", "'x'"),
    ("sizes", [6, 0], "sizes[1]", "0", "1"),
    ("sizes", 6, "sizes", "6"),
    ("inner", 4, "inner", "4", "count", "kind", "optional"),
    ("inner", {"count": 1, "kind": "huge"}, "inner.kind", "'huge'", "'small'", "'large'"),
    ("inner", {"kind": "small"}, "inner.count"),
    ("inner", {"count": 11, "kind": "small"}, "inner", "10", "11"),
    ("inner", MISSPELT, "inner.cuont", "inner.count"),
    ("many", {"x": MISSPELT}, "many.x.cuont", "many.x.count"),
    ("many", {"x": {"count": "y", "kind": "small"}}, "many.x.count", "'y'"),
    ("regions", [MISSPELT], "regions[0].cuont", "regions[0].count"),
    ("words", {"one": [1]}, "words.one", "[1]"),
    ("files", 2, "files", "2", "1"),
    ("files", [2], "files[0]", "2", "count", "kind", "optional"),
    ("files", ["a", {"count": 0, "kind": "large"}], "files[1].count", "0", "1"),
    ("nmae", 1, "nmae", "name"),
    ("zzz", 1, "zzz"),
]


@pytest.mark.parametrize(("key", "value", "about"), [(key, value, about) for key, value, *about in WRONG])
def test_a_wrong_value_is_reported_with_its_key_and_what_was_expected(key, value, about):
    with refused(ConfigError, *about) as caught:
        build(Outer, {**GOOD, key: value})
    assert "\n" not in str(caught.value)  # this one alone


def test_all_problems_are_reported_at_once():
    with refused(ConfigError, "3", "seed", "inner.count", "extra"):
        build(Outer, {**GOOD, "seed": "x", "inner": {"count": 0, "kind": "small"}, "extra": 1})


def test_any_mapping_is_read_and_what_is_missing_is_told_beside_a_name_that_is_like_none():
    assert settings_of(Inner, MappingProxyType({"count": 3, "kind": "small"})) == Inner(3, "small")
    with refused(ConfigError, "2", "count", "zzz"):
        build(Inner, {"kind": "small", "zzz": 1})
