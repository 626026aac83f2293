"""Settings as text: as arguments of the command, and in messages as who reads them writes settings.

The command prefixes settings with their group, ``robot.effort=0.5``. In Python they are arguments of
functions, ``effort=0.5``, or mappings of fields, ``workspace={'torque': False}``.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import is_dataclass
from shlex import quote
from typing import Any

FILL_IN = "…"  # a value for the user to fill in

_WORD = re.compile(r"…|(\.{0,2}/|[A-Za-z_])[A-Za-z0-9_/.-]*")  # text that the command takes without quotes
_RESERVED = re.compile(r"[\\()\[\]{}:=,\s]")  # in names of a mapping
_ROUNDED = ".6g"  # numbers that are computed for people
_EXACT = 2**53  # below which whole numbers, such as encoder counts, are written in full
_NO_TEXT = {"null", "true", "false", "yes", "no", "on", "off", "nan", "inf"}
_OF_THE_CELL = ("robot", "trajectory")  # groups whose settings are arguments of a Cell
_IN_PYTHON = {  # settings of the command that differ in Python by more than their group
    "robot.name": "robot",
    "workspace.clearance": "clearance",
}
_FIELDS = {("workspace", "free"): {"desk": None}}  # files of settings that a command chooses, as their fields

_of_a_command: ContextVar[bool] = ContextVar("of_a_command", default=False)


@contextmanager
def command_messages() -> Iterator[None]:
    """Messages within the block suggest settings as the command takes them, otherwise as Python does."""
    token = _of_a_command.set(True)
    try:
        yield
    finally:
        _of_a_command.reset(token)


def suggestion(name: str, value: object, digits: str = "") -> str:
    """A setting for a message, with the name that the command has for it; ``digits`` as of ``setting``."""
    if _of_a_command.get():
        return setting(name, value, digits)
    argument, *fields = setting_name(name).split(".")
    value = _FIELDS.get((name, str(value)), value)
    for field in reversed(fields):
        value = {field: value}
    return f"{argument}={_text(value, digits, python=True)}"


def suggest_fields(group: str, fields: Mapping[str, object], digits: str = "") -> str:
    """Several settings of a group for a message: arguments of the command, or one mapping in Python."""
    if _of_a_command.get():
        return " ".join(setting(f"{group}.{name}", value, digits) for name, value in fields.items())
    return suggestion(group, fields, digits)


def setting_name(name: str) -> str:
    """The name that a setting of the command has for the reader of a message, such as home or robot.mount."""
    if _of_a_command.get():
        return name
    group, _, rest = name.partition(".")
    return _IN_PYTHON.get(name, rest if group in _OF_THE_CELL else name)


def suggest_by_joint(
    name: str, values: Mapping[str, object], given: Mapping[str, object] | None = None
) -> str:
    """A setting of the arm by joint name for a message, including values given before."""
    return suggestion(f"robot.{name}", {**(given or {}), **values}, _ROUNDED)


def suggest_limits(
    values: Mapping[str, Mapping[str, object]], given: Mapping[str, object] | None = None
) -> str:
    """Limits of the arm by kind and joint for a message, including those given before.

    In Python they are one setting, which then includes all that were given.
    """
    before: dict[str, Any] = {kind: x for kind, x in (given or {}).items() if x is not None}
    fields = {kind: {**before.get(kind, {}), **x} for kind, x in values.items()}
    return suggest_fields("robot.limits", fields if _of_a_command.get() else before | fields, _ROUNDED)


def suggest_touching(pairs: Iterable[Sequence[str]], given: Iterable[Sequence[str]] | None = None) -> str:
    """The setting that lets pairs of links touch for a message, including pairs given before."""
    named = dict.fromkeys(tuple(sorted(pair)) for pair in (*(given or ()), *pairs))
    return suggestion("robot.may_touch", [*named])


def setting(name: str, value: object, digits: str = "") -> str:
    """A setting as an argument of the command; ``digits``: the format of its numbers, by default exact."""
    return f"{name}={value}" if value == FILL_IN else quote(f"{name}={_text(value, digits)}")


def robot_settings(name: str, setup: object) -> str:
    """An arm's description and setup as arguments of the command."""
    return " ".join([setting("robot.name", name), *changes("robot", setup)])


def changes(group: str, settings: Any) -> list[str]:
    """Settings of a group that differ from their defaults, as arguments of the command."""
    own: list[str] = []
    inner: list[str] = []
    default = type(settings)()
    for name, value in vars(settings).items():
        usual = getattr(default, name)
        if value == usual:
            continue
        if is_dataclass(usual):
            inner += changes(f"{group}.{name}", value)
        else:
            own.append(setting(f"{group}.{name}", value))
    return own + inner


def _text(value: object, digits: str, python: bool = False) -> str:
    """A value as written in Python, apart from what is to be filled in, or in the command."""
    if is_dataclass(value):  # instead of null
        value = {name: x for name, x in vars(value).items() if x is not None}
    match value:
        case Mapping():
            rows = {_name(name, python): _text(x, digits, python) for name, x in value.items()}
            return f"{{{', '.join(f'{name}: {x}' for name, x in rows.items())}}}"
        case list() | tuple():
            return f"[{', '.join(_text(x, digits, python) for x in value)}]"
        case None if not python:
            return "null"
        case bool():
            return str(value) if python else str(value).lower()
        case int():
            return str(value)
        case float():
            return f"{value:.0f}" if value.is_integer() and abs(value) < _EXACT else f"{value:{digits}}"
    if python:
        return FILL_IN if value == FILL_IN else repr(value)
    return _word(str(value))


def _name(name: object, python: bool) -> str:
    """The name of a value in a mapping."""
    return repr(name) if python else _RESERVED.sub(r"\\\g<0>", str(name))


def _word(text: str) -> str:
    """Text for the command, in quotes if it could be read as something else."""
    if _WORD.fullmatch(text) and text.lower() not in _NO_TEXT:
        return text
    literal = re.sub(r"(\\*)\$\{", r"\1\1\\${", text)  # no interpolation
    return '"' + re.sub(r'\\+(?="|\Z)', r"\g<0>\g<0>", literal).replace('"', r"\"") + '"'
