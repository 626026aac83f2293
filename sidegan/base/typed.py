"""Plain mappings → dataclasses, with complaints that name the key, the value and what was expected.

The type hints are the schema: int, float, str, bool, Literal, ``X | None``, a list or one value, tuple of
fixed length, dict, other dataclasses, and ``Annotated`` with the bounds below. A dataclass may refuse
combinations in ``__post_init__`` by raising ConfigError.
"""

import dataclasses
import difflib
import math
import operator
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from sidegan.errors import ConfigError

T = TypeVar("T")


_LARGEST, _SMALLEST = 1e12, 1e-12  # beyond them a number is a mistake, and powers of it are none
_ALIKE = 0.6  # of two words from which on one may be meant by the other
_COMPARISONS = {"≥": operator.ge, "≤": operator.le, ">": operator.gt, "<": operator.lt}


@dataclasses.dataclass(frozen=True)
class Bound:
    """What a number must be: ≥, ≤, > or < ``limit``."""

    sign: Literal["≥", "≤", ">", "<"]
    limit: float

    def __str__(self) -> str:
        return f"{self.sign} {self.limit:g}"

    def holds(self, value: float) -> bool:
        """Whether ``value`` respects the bound."""
        return bool(_COMPARISONS[self.sign](value, self.limit))


@dataclasses.dataclass(frozen=True)
class Written:
    """Of a text: it may look like a number or a truth value, and is kept as these are written."""

    def __str__(self) -> str:
        return "or a number"

    def holds(self, value: str) -> bool:
        """Whether ``value`` respects the bound."""
        return True


Text = Annotated[str, Written()]
Natural = Annotated[int, Bound("≥", 0)]
Count = Annotated[int, Bound("≥", 1), Bound("≤", 1e9)]  # how many of something, one after the other
Size = Annotated[int, Bound("≥", 1), Bound("≤", 1e5)]  # how many at once: an axis of an array
Width = Annotated[int, Bound("≥", 1), Bound("≤", 1e4)]  # both axes of one: a layer of a network
Seconds = Annotated[float, Bound("≥", 1e-3), Bound("≤", 1e5)]  # of a motion that a person waits for
Hertz = Annotated[float, Bound(">", 0), Bound("≤", 1e5)]  # of sampling
Positive = Annotated[float, Bound(">", 0)]
NonNegative = Annotated[float, Bound("≥", 0)]
Share = Annotated[float, Bound("≥", 0), Bound("≤", 1)]
Part = Annotated[float, Bound(">", 0), Bound("≤", 1)]  # a share that is not nothing
Open = Annotated[float, Bound(">", 0), Bound("<", 1)]  # a share that leaves something


def build(kind: type[T], values: Mapping[str, Any]) -> T:
    """A dataclass of type ``kind`` from nested plain values.

    Raises:
        ConfigError: with one line for every unknown or missing key, wrong type and value out of bounds.
    """
    reader = _Reader(kind)
    try:
        return reader.record(kind, values, "")
    except _Wrong:
        problems = reader.problems
        head = [] if len(problems) == 1 else [f"{len(problems)} settings are wrong"]
        raise ConfigError("\n  ".join([*head, *problems])) from None


def suggest(kind: type, key: str, beside: Iterable[str] = ()) -> str:
    """What the user may have meant by the unknown dotted ``key``: "; did you mean …?" or nothing.

    Args:
        kind: of all settings.
        key: what there is not.
        beside: names of the settings of its group, where they are known; they are meant first.
    """
    path, _, leaf = key.rpartition(".")
    if near := difflib.get_close_matches(leaf, beside, 1, _ALIKE):
        return f"; did you mean {_join(path, near[0])}?"
    known = list(dict.fromkeys(_dotted(kind)))
    close = difflib.get_close_matches(key, known, 1, 0.75) or [
        k for k in known if k.rpartition(".")[2] == leaf
    ]
    return f"; did you mean {' or '.join(close[:3])}?" if close else ""


def settings_of(kind: type, group: str) -> list[str]:
    """Names of the settings of a dotted ``group``; none where it is no group."""
    parts = (key.rpartition(".") for key in _dotted(kind))
    return list(dict.fromkeys(name for path, _, name in parts if path == group))


class _Wrong(Exception):  # noqa: N818
    """A value could not be read; the problem is on the list already."""


class _Reader:
    def __init__(self, root: type) -> None:
        self.root = root
        self.problems: list[str] = []

    def record(self, kind: type[T], values: Any, path: str) -> T:
        if not isinstance(values, Mapping):
            raise self._wrong(path, values, "a group of settings")
        before = len(self.problems)
        found = self._fields(kind, values, path)
        if len(self.problems) > before:
            raise _Wrong
        try:
            return kind(**found)
        except ConfigError as error:
            self.problems.append(f"{path}: {error}" if path else str(error))
            raise _Wrong from error

    def _fields(self, kind: type, values: Mapping[str, Any], path: str) -> dict[str, Any]:
        hints = get_type_hints(kind, include_extras=True)
        strange = [_join(path, key) for key in values if key not in hints]
        for unknown in strange:
            meant = suggest(self.root, unknown, hints)
            self.problems.append(f"{unknown}: there is no such setting{meant}")
        found = {}
        for field in dataclasses.fields(kind):
            key = _join(path, field.name)
            if field.name in values:
                with suppress(_Wrong):  # go on, so that all problems are told at once
                    found[field.name] = self.value(hints[field.name], values[field.name], key)
            elif field.default is dataclasses.MISSING and not strange:  # else it may be the misspelt one
                self.problems.append(f"{key} is missing, expected {_expected(hints[field.name])}")
        return found

    def value(self, hint: Any, value: Any, path: str) -> Any:
        if value is None and NoneType in get_args(hint):
            return None
        plain, bounds, _ = _unwrap(_arm(hint, value))
        if dataclasses.is_dataclass(plain):
            return self.record(plain, value, path)  # type: ignore[arg-type]
        origin, arguments = get_origin(plain), get_args(plain)
        if origin is dict and isinstance(value, Mapping):
            return {str(k): self.value(arguments[1], v, _join(path, str(k))) for k, v in value.items()}
        if origin is list and isinstance(value, list):
            return [self.value(arguments[0], v, f"{path}[{i}]") for i, v in enumerate(value)]
        if origin is tuple and isinstance(value, list) and len(value) == len(arguments):
            return tuple(self.value(a, v, f"{path}[{i}]") for i, (a, v) in enumerate(zip(arguments, value)))
        if origin is Literal and value in arguments:
            return value
        if any(isinstance(bound, Written) for bound in bounds) and isinstance(value, int | float):
            return str(value).lower()
        if _is(plain, value) and all(bound.holds(value) for bound in bounds):
            if plain is float and not _sensible(value, bounds):
                raise self._wrong(path, value, f"a number between {_SMALLEST:g} and {_LARGEST:g} in size")
            return float(value) if plain is float else value
        raise self._wrong(path, value, _expected(hint, null=False))

    def _wrong(self, path: str, value: Any, expected: str) -> _Wrong:
        self.problems.append(f"{path} is {value!r}, expected {expected}")
        return _Wrong()


def _is(plain: Any, value: Any) -> bool:
    if plain is float:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if plain is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return plain in (str, bool) and isinstance(value, plain)


def _sensible(value: float, bounds: Sequence[Bound]) -> bool:
    """Whether a number is of a size that can be meant; what must not be zero must not nearly be zero."""
    nearly_zero = any(bound.sign == ">" and bound.limit == 0 for bound in bounds) and value < _SMALLEST
    return abs(value) <= _LARGEST and not nearly_zero


_NAMES = {int: "a whole number", float: "a number", str: "text", bool: "true or false"}


def _expected(hint: Any, null: bool = True) -> str:
    if len(arms := _arms(hint)) > 1:
        either = [*map(_expected, arms), *(["null"] if null and NoneType in get_args(hint) else [])]
        return ", or ".join(either)
    plain, bounds, optional = _unwrap(hint)
    origin, arguments = get_origin(plain), get_args(plain)
    if optional and null:
        return f"{_expected(hint, null=False)}, or null"
    if origin is Literal:
        return f"one of {', '.join(map(str, arguments))}"
    if origin is list:
        return f"a list, each item {_expected(arguments[0])}"
    if origin is tuple:
        return f"a list of {len(arguments)}, each item {_expected(arguments[0])}"
    if plain in _NAMES:
        return " ".join([_NAMES[plain], " and ".join(map(str, bounds))]).strip()
    return "a group of settings"


def _arms(hint: Any) -> list[Any]:
    """The alternatives of a union but for None; the hint itself of any other."""
    union = get_origin(hint) in (Union, UnionType)
    return [a for a in get_args(hint) if a is not NoneType] if union else [hint]


def _arm(hint: Any, value: Any) -> Any:
    """Of a union of a list, a group and a single value the one that a value may be; else the hint."""
    arms, shape = (
        _arms(hint),
        list if isinstance(value, list) else dict if isinstance(value, Mapping) else None,
    )
    shapes = [dict if dataclasses.is_dataclass(arm) else get_origin(arm) for arm in arms]
    fitting = [arm for arm, of in zip(arms, shapes) if (of if of in (list, dict) else None) is shape]
    return fitting[0] if len(arms) > 1 and fitting else hint


def _unwrap(hint: Any) -> tuple[Any, list[Any], bool]:
    """The plain type, its bounds, and whether None is allowed."""
    optional = get_origin(hint) in (Union, UnionType)
    if optional:
        hint = next(a for a in get_args(hint) if a is not NoneType)
    plain, *bounds = get_args(hint) if get_origin(hint) is Annotated else [hint]
    return plain, bounds, optional


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else str(key)


def _dotted(hint: Any, path: str = "") -> Iterator[str]:
    plain, _, _ = _unwrap(hint)
    if path:
        yield path
    if dataclasses.is_dataclass(plain):
        for name, inner in get_type_hints(plain, include_extras=True).items():
            yield from _dotted(inner, _join(path, name))
    elif get_origin(plain) is dict:
        yield from _dotted(get_args(plain)[1], _join(path, "<name>"))
