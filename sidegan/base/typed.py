"""Settings as dataclasses, validated by pydantic, with errors that name the setting and the value.

The rooms' dataclasses are the schema. Types below have bounds; a dataclass refuses invalid combinations in
``__post_init__`` by a ConfigError.
"""

import dataclasses
import difflib
import json
from collections.abc import Mapping, Sequence
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError

from sidegan.errors import ConfigError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

T = TypeVar("T")
Place = tuple[str | int, ...]  # keys and indices that lead to a value

# Numbers beyond 1e12 are mistakes, and their powers overflow; those below 1e-12 are as good as zero. Bounds
# also refuse numbers that are not finite.
Number = Annotated[float, Field(ge=-1e12, le=1e12)]
Positive = Annotated[float, Field(ge=1e-12, le=1e12)]
NonNegative = Annotated[float, Field(ge=0, le=1e12)]
Share = Annotated[float, Field(ge=0, le=1)]
PositiveShare = Annotated[float, Field(ge=1e-12, le=1)]  # in (0, 1]
ShareBelowOne = Annotated[float, Field(ge=1e-12, lt=1)]  # in (0, 1)
Seconds = Annotated[float, Field(ge=1e-3, le=1e5)]  # durations of motions
Hertz = Annotated[float, Field(ge=1e-12, le=1e5)]  # sampling rates and bandwidths
Natural = Annotated[int, Field(ge=0)]
Count = Annotated[int, Field(ge=1, le=10**9)]  # number of repetitions
Size = Annotated[int, Field(ge=1, le=10**5)]  # length of an array's axis
Width = Annotated[int, Field(ge=1, le=10**4)]  # rows and columns of a square matrix, as a layer's weights


def _as_text(value: object) -> object:
    """A number or a boolean as a command writes it."""
    return str(value).lower() if isinstance(value, int | float) else value


Text = Annotated[str, BeforeValidator(_as_text)]  # may be given as a number or a boolean

_UNKNOWN = "unexpected_keyword_argument"  # pydantic's error type for an unknown setting
_SIGNS = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
_EXPECTED = {  # by pydantic's error type
    "int_type": "a whole number",
    "float_type": "a number",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a group of settings",
    "dataclass_type": "a group of settings",
}
_GROUP_ERRORS = ("dict_type", "dataclass_type")


def build(kind: type[T], values: Mapping[str, Any]) -> T:
    """A dataclass from nested plain values; ConfigError with a line for each wrong or missing setting."""
    # By way of JSON, where strict mode still takes lists for tuples, and arrays become plain.
    try:
        text = json.dumps(values, default=_plain)
    except TypeError as error:  # of a key
        raise ConfigError(f"settings are {values!r}: {error}") from error
    try:
        return TypeAdapter(kind).validate_json(text, strict=True, extra="forbid")
    except ValidationError as error:
        problems = _problems(kind, error, json.loads(text))
    head = [] if len(problems) == 1 else [f"{len(problems)} settings are wrong"]
    raise ConfigError("\n  ".join([*head, *problems]))


def settings_of(kind: type[T], given: T | Mapping[str, Any] | None) -> T:
    """Settings given as a dataclass or as plain values of its fields.

    Raises:
        ConfigError: when a setting is unknown or out of range; names it.
    """
    if not (given is None or isinstance(given, kind | Mapping)):
        raise ConfigError(f"settings are {given!r}, expected {kind.__name__} or a mapping of its fields")
    if isinstance(given, kind):  # dataclasses do not check what they are given in Python
        return build(kind, dataclasses.asdict(given))  # type: ignore[call-overload]
    return build(kind, given or {})  # type: ignore[arg-type]


def changed(settings: T, changes: Mapping[str, Any]) -> T:
    """A copy of settings with changes, as in a command.

    A mapping changes only the keys that it names; any other value replaces the old one.

    Raises:
        ConfigError: when a setting is unknown or out of range; names it.
    """
    return build(type(settings), _merged(dataclasses.asdict(settings), changes))  # type: ignore[call-overload]


def _merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Values with changes; mappings are merged at every depth."""
    merged = dict(values)
    for key, new in changes.items():
        groups = isinstance(new, Mapping) and isinstance(values.get(key), Mapping)
        merged[key] = _merged(values[key], new) if groups else new
    return merged


def _plain(value: Any) -> Any:
    """Arrays, dataclasses, mappings and paths as JSON values."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.asdict(value)
    if isinstance(value, Mapping):
        return dict(value)
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _problems(kind: type, error: ValidationError, values: Any) -> list[str]:
    """A line for each wrong setting; of alternative types, only errors of the one that fails deepest."""
    found: dict[Place, list[ErrorDetails]] = {}
    for detail in error.errors():
        found.setdefault(_place(detail, values), []).append(detail)
    misspelt = set[Place]()  # groups with a setting whose name is like one of theirs
    for place, errors in found.items():
        if errors[0]["type"] == _UNKNOWN and did_you_mean(kind, place):
            misspelt.add(place[:-1])
    lines = []
    for place, errors in found.items():
        deeper = any(other != place and other[: len(place)] == place for other in found)
        explained = errors[0]["type"] == "missing" and place[:-1] in misspelt
        if not deeper and not explained:
            lines.append(_line(kind, place, errors))
    return lines


def _place(error: "ErrorDetails", values: Any) -> Place:
    """Keys that lead to the value, without the names of alternative types that pydantic inserts."""
    place: list[str | int] = []
    for key in error["loc"]:
        indices = range(len(values)) if isinstance(values, list) else ()
        if key in (values if isinstance(values, dict) else indices):
            values = values[key]
            place.append(key)
    return (*place, error["loc"][-1]) if error["type"] == "missing" else tuple(place)


def _line(kind: type, place: Place, errors: "list[ErrorDetails]") -> str:
    name = _name(place)
    error = next((detail for detail in errors if detail["type"] == "value_error"), errors[0])
    if error["type"] == "value_error":  # raised by a dataclass
        return f"{name}: {error['ctx']['error']}".removeprefix(": ")
    if error["type"] == "missing":
        return f"{name} is missing"
    if error["type"] == _UNKNOWN:
        return f"{name}: there is no such setting{did_you_mean(kind, place)}"
    fields = names_in(kind, place)
    named = f" ({', '.join(fields)})" if fields and any(x["type"] in _GROUP_ERRORS for x in errors) else ""
    expected = ", or ".join(dict.fromkeys(map(_expected, errors)))
    return f"{name or 'the value'} is {error['input']!r}, expected {expected}{named}"


def _expected(error: "ErrorDetails") -> str:
    for sign, limit in error.get("ctx", {}).items():
        if sign in _SIGNS:
            kind, form = ("a whole number", ",") if isinstance(limit, int) else ("a number", "g")
            return f"{kind} {_SIGNS[sign]} {limit:{form}}"
    return _EXPECTED.get(error["type"], error["msg"].removeprefix("Input should be "))


def did_you_mean(kind: type, place: Place) -> str:
    """Question after an unknown setting, "; did you mean …?", or nothing."""
    for depth, key in enumerate(place):
        names = names_in(kind, place[:depth])
        if names and key not in names:
            near = difflib.get_close_matches(str(key), names, 1)
            meant = _name((*place[:depth], *near, *place[depth + 1 :]))
            return f"; did you mean {meant}?" if near else ""
    return ""


def names_in(kind: Any, group: Sequence[str | int]) -> list[str]:
    """Names of a group's settings; ``group`` are the keys that lead to it. Empty if it is not a group."""
    found: list[str] = []
    options = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    for option in options:
        settings = get_type_hints(option) if dataclasses.is_dataclass(option) else {}
        if not group:
            found += settings
        elif group[0] in settings:
            found += names_in(settings[str(group[0])], group[1:])
        elif get_origin(option) in (dict, list):
            found += names_in(get_args(option)[-1], group[1:])
    return found


def _name(place: Place) -> str:
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place).removeprefix(".")
