"""Settings are read by the types of their dataclass, and every mistake is named."""

import dataclasses
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidegan.base.typed import Bound, Count, Natural, NonNegative, Positive, Text, build, settings_of, suggest
from sidegan.errors import ConfigError


@dataclasses.dataclass(frozen=True)
class Inner:
    count: Count
    kind: Literal["small", "large"]
    optional: float | None = None

    def __post_init__(self):
        if self.kind == "small" and self.count > 10:
            raise ConfigError(f"a small one has at most 10, got {self.count}")


Share = Annotated[float, Bound(">", 0), Bound("≤", 1)]


@dataclasses.dataclass(frozen=True)
class Outer:
    seed: Natural
    rate: Positive
    weight: NonNegative
    share: Share
    name: str
    on: bool
    corner: tuple[float, float]
    sizes: list[Count]
    inner: Inner
    many: dict[str, Inner]
    home: list[float] | None
    words: dict[str, Text]
    files: list[str] | Share


GOOD = {"seed": 0, "rate": 100, "weight": 0.0, "share": 1, "name": "a", "on": True, "corner": [1, 2.5]}
GOOD |= {"sizes": [6, 210], "home": None, "inner": {"count": 3, "kind": "small"}, "files": 0.5}
GOOD |= {"many": {"first": {"count": 30, "kind": "large", "optional": 2}}}
GOOD |= {"words": {"number": 0.2, "whole": 3, "truth": True, "text": "a b"}}


def test_every_kind_of_value_is_read():
    outer = build(Outer, GOOD)
    assert outer.inner == Inner(3, "small") and outer.many == {"first": Inner(30, "large", 2.0)}
    assert outer.corner == (1.0, 2.5) and outer.sizes == [6, 210] and outer.home is None
    assert isinstance(outer.rate, float), "a whole number is a number"
    assert list(outer.words.values()) == ["0.2", "3", "true", "a b"], "a text may be written as a number"
    assert outer.files == 0.5 and build(Outer, {**GOOD, "files": ["a"]}).files == ["a"]


@given(st.integers(0, 10**6), st.floats(1e-9, 1e12), st.text(max_size=5))
def test_what_was_read_reads_back_the_same(seed, rate, name):
    outer = build(Outer, {**GOOD, "seed": seed, "rate": rate, "name": name})
    assert build(Outer, {**dataclasses.asdict(outer), "corner": list(outer.corner)}) == outer


COUNT = "a whole number ≥ 1 and ≤ 1e+09"
# One mistake, and not a missing setting too.
MISSPELT = "inner.cuont: there is no such setting; did you mean inner.count?"


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("seed", 1.0, "seed is 1.0, expected a whole number ≥ 0"),
        ("seed", True, "seed is True, expected a whole number ≥ 0"),
        ("seed", -1, "seed is -1, expected a whole number ≥ 0"),
        ("rate", float("nan"), "rate is nan, expected a number > 0"),
        ("weight", float("inf"), "weight is inf, expected a number ≥ 0"),
        ("share", 1.5, "share is 1.5, expected a number > 0 and ≤ 1"),
        ("name", 3, "name is 3, expected text"),
        ("on", 1, "on is 1, expected true or false"),
        ("corner", [1], "corner is [1], expected a list of 2, each item a number"),
        ("sizes", [6, 0], f"sizes[1] is 0, expected {COUNT}"),
        ("sizes", 6, f"sizes is 6, expected a list, each item {COUNT}"),
        ("inner", 4, "inner is 4, expected a group of settings"),
        ("inner", {"count": 1, "kind": "huge"}, "inner.kind is 'huge', expected one of small, large"),
        ("inner", {"kind": "small"}, f"inner.count is missing, expected {COUNT}"),
        ("inner", {"count": 11, "kind": "small"}, "inner: a small one has at most 10, got 11"),
        ("inner", {"cuont": 3, "kind": "small"}, MISSPELT),
        ("many", {"x": {"count": "y", "kind": "small"}}, f"many.x.count is 'y', expected {COUNT}"),
        ("home", "zero", "home is 'zero', expected a list, each item a number"),
        ("words", {"one": [1]}, "words.one is [1], expected text or a number"),
        ("files", 2, "files is 2, expected a list, each item text, or a number > 0 and ≤ 1"),
        ("files", [2], "files[0] is 2, expected text"),
    ],
)
def test_a_wrong_value_is_named_with_its_key_and_what_was_expected(key, value, words):
    with pytest.raises(ConfigError) as error:
        build(Outer, {**GOOD, key: value})
    assert str(error.value) == words


def test_all_problems_are_told_at_once():
    with pytest.raises(ConfigError, match=r"(?s)^3 settings are wrong\n.*extra.*seed.*inner\.count"):
        build(Outer, {**GOOD, "seed": "x", "inner": {"count": 0, "kind": "small"}, "extra": 1})


def test_what_is_meant_is_looked_for_in_the_same_group_first_and_elsewhere_then():
    groups = {**GOOD, "many": {"first": {"count": 3, "kidn": "large", "kind": "large"}}}
    with pytest.raises(ConfigError, match=r"many.first.kidn: .*; did you mean many.first.kind\?"):
        build(Outer, groups)
    assert suggest(Outer, "inner.kid", ["kind"]) == "; did you mean inner.kind?"
    assert suggest(Outer, "kind") == "; did you mean inner.kind or many.<name>.kind?"
    assert suggest(Outer, "zzz") == ""
    assert settings_of(Outer, "inner") == ["count", "kind", "optional"] and settings_of(Outer, "seed") == []
