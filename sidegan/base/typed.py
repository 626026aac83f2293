"""Settings: plain values → dataclasses by pydantic, with complaints that name the setting and the value.

The dataclasses of the rooms are the schema. A number has its bounds in its type, by the names below; a
dataclass refuses combinations in ``__post_init__`` by raising ConfigError.
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

# Beyond 1e12 a number is a mistake, and powers of it are none; below 1e-12 what must not be zero nearly is.
# A bound refuses what is no finite number too.
Number = Annotated[float, Field(ge=-1e12, le=1e12)]
Positive = Annotated[float, Field(ge=1e-12, le=1e12)]
NonNegative = Annotated[float, Field(ge=0, le=1e12)]
Share = Annotated[float, Field(ge=0, le=1)]
Part = Annotated[float, Field(ge=1e-12, le=1)]  # a share that is not nothing
Open = Annotated[float, Field(ge=1e-12, lt=1)]  # a share that leaves something
Seconds = Annotated[float, Field(ge=1e-3, le=1e5)]  # of a motion that a person waits for
Hertz = Annotated[float, Field(ge=1e-12, le=1e5)]  # of sampling
Natural = Annotated[int, Field(ge=0)]
Count = Annotated[int, Field(ge=1, le=10**9)]  # how many of something, one after the other
Size = Annotated[int, Field(ge=1, le=10**5)]  # how many at once: an axis of an array
Width = Annotated[int, Field(ge=1, le=10**4)]  # both axes of an array: a layer of a network


def _written(value: object) -> object:
    return str(value).lower() if isinstance(value, int | float) else value


Text = Annotated[str, BeforeValidator(_written)]  # may look like a number or a truth value

_UNKNOWN = "unexpected_keyword_argument"  # as pydantic calls a key that is no setting
_SIGNS = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
_KINDS = {
    "int_type": "a whole number",
    "float_type": "a number",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a group of settings",
    "dataclass_type": "a group of settings",
}


def build(kind: type[T], values: Mapping[str, Any]) -> T:
    """A dataclass from nested plain values; a ConfigError has one line for every wrong or missing setting."""
    text = json.dumps(values, default=_plain)
    try:
        return TypeAdapter(kind).validate_json(text, strict=True, extra="forbid")
    except ValidationError as error:
        problems = _problems(kind, error, json.loads(text))
    head = [] if len(problems) == 1 else [f"{len(problems)} settings are wrong"]
    raise ConfigError("\n  ".join([*head, *problems]))


def settings_of(kind: type[T], given: T | Mapping[str, Any] | None) -> T:
    """Settings as they are given: a dataclass, or plain values of its fields; the others have defaults.

    Raises:
        ConfigError: when a value is unknown or out of range; names it.
    """
    return given if isinstance(given, kind) else build(kind, given or {})  # type: ignore[arg-type]


def _plain(value: Any) -> Any:
    """Arrays, dataclasses and paths as JSON has them."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.asdict(value)
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _problems(kind: type, error: ValidationError, values: Any) -> list[str]:
    """Complaints, a line for each setting; of alternatives that of which most is right."""
    found: dict[Place, list[ErrorDetails]] = {}
    for one in error.errors():
        found.setdefault(_place(one, values), []).append(one)
    misspelt = {place[:-1] for place, (one, *_) in found.items() if one["type"] == _UNKNOWN}
    lines = []
    for place, errors in found.items():
        missing = errors[0]["type"] == "missing" and place[:-1] in misspelt  # it may be the misspelt one
        if not missing and not any(other != place and other[: len(place)] == place for other in found):
            lines.append(_line(kind, place, errors))
    return lines


def _place(error: "ErrorDetails", values: Any) -> Place:
    """The keys that lead to the value; pydantic names the alternatives of types in between."""
    place: list[str | int] = []
    for key in error["loc"]:
        keys = values if isinstance(values, dict) else range(len(values)) if isinstance(values, list) else ()
        if key in keys:
            values = values[key]
            place.append(key)
    return (*place, error["loc"][-1]) if error["type"] == "missing" else tuple(place)


def _line(kind: type, place: Place, errors: "list[ErrorDetails]") -> str:
    name = _name(place)
    error = next((one for one in errors if one["type"] == "value_error"), errors[0])
    if error["type"] == "value_error":  # a dataclass's own
        return f"{name}: {error['ctx']['error']}".removeprefix(": ")
    if error["type"] == "missing":
        return f"{name} is missing"
    if error["type"] == _UNKNOWN:
        return f"{name}: there is no such setting{suggest(kind, place)}"
    return f"{name} is {error['input']!r}, expected {', or '.join(map(_expected, errors))}"


def _expected(error: "ErrorDetails") -> str:
    for sign, limit in error.get("ctx", {}).items():
        if sign in _SIGNS:
            return f"{'a whole number' if isinstance(limit, int) else 'a number'} {_SIGNS[sign]} {limit:g}"
    return _KINDS.get(error["type"], error["msg"].removeprefix("Input should be "))


def suggest(kind: type, place: Place) -> str:
    """Setting that may have been meant by one that is not there: "; did you mean …?" or nothing."""
    for depth, key in enumerate(place):
        names = names_in(kind, place[:depth])
        if names and key not in names:
            near = difflib.get_close_matches(str(key), names, 1)
            meant = _name((*place[:depth], *near, *place[depth + 1 :]))
            return f"; did you mean {meant}?" if near else ""
    return ""


def names_in(kind: Any, group: Sequence[str | int]) -> list[str]:
    """Names of the settings of a group, by the keys that lead to it; none where it is no group."""
    found: list[str] = []
    for one in get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,):
        settings = get_type_hints(one) if dataclasses.is_dataclass(one) else {}
        if not group:
            found += settings
        elif group[0] in settings:
            found += names_in(settings[str(group[0])], group[1:])
        elif get_origin(one) in (dict, list):
            found += names_in(get_args(one)[-1], group[1:])
    return found


def _name(place: Place) -> str:
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place).removeprefix(".")
