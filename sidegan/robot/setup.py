"""A user's settings of an arm, in addition to its description."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from itertools import chain
from shlex import quote
from typing import Any

from sidegan.base.typed import Number, Positive, Text

Mount = tuple[Number, Number, Number]


@dataclass(frozen=True)
class Limits:
    """Limits by joint name, or one number for all joints, that override the description's if not null."""

    position: dict[str, tuple[Number, Number]] | Positive | None = None  # lower and upper, or ± [rad or m]
    velocity: dict[str, Positive] | Positive | None = None  # [rad/s or m/s]
    acceleration: dict[str, Positive] | Positive | None = None  # [rad/s² or m/s²]
    jerk: dict[str, Positive] | Positive | None = None  # [rad/s³ or m/s³]
    effort: dict[str, Positive] | Positive | None = None  # [N·m or N]
    file: str | None = None  # MoveIt's joint_limits.yaml, which all of these override

    def of_joints(self, names: Iterable[str]) -> "Limits":
        """The same limits, with single numbers expanded to all joints."""
        joints = list(names)
        changed = dict[str, Any]()
        for kind, value in vars(self).items():
            if isinstance(value, int | float):
                changed[kind] = dict.fromkeys(joints, (-value, value) if kind == "position" else value)
        return replace(self, **changed)


@dataclass(frozen=True)
class Setup:
    """Which part of a description is the arm, positions of the other joints, mounting, and limits."""

    args: dict[str, Text] | None = None  # arguments of a xacro file
    tip: str | None = None  # last link of the arm; null: the end of the only chain
    locked: dict[str, Number] | None = None  # positions of locked joints [rad or m]
    # roll, pitch and yaw [rad] of the first link in a world whose z points up; null: upright, or as an MJCF's
    # gravity says
    mount: Mount | None = None
    limits: Limits = Limits()
    may_touch: list[tuple[str, str]] | None = None  # pairs of links not checked for collision
    friction: bool = True  # whether the description's friction and rotors count in torques


PLAIN = Setup()
_WORD = re.compile(r"…|(\.{0,2}/|[A-Za-z_])[A-Za-z0-9_/.-]*")  # text without quotes; … is to be filled in
_RESERVED = re.compile(r"[\\()\[\]{}:=,\s]")  # in names of a mapping
_ROUNDED = ".6g"  # numbers that are computed for people
_EXACT = 2**53  # below which whole numbers, such as encoder counts, are written in full
_NO_TEXT = {"null", "true", "false", "yes", "no", "on", "off", "nan", "inf"}


def setting(name: str, value: object, digits: str = "") -> str:
    """A setting as an argument of the command; ``digits``: the format of its numbers, by default exact."""
    return quote(f"{name}={_plain(value, digits)}")


def override(name: str, values: Mapping[str, object], given: Mapping[str, object] | None = None) -> str:
    """A setting of the arm by joint name as an argument of the command, including values given before."""
    return setting(f"robot.{name}", {**(given or {}), **values}, _ROUNDED)


def allowed(pairs: Iterable[Sequence[str]], given: Iterable[Sequence[str]] | None = None) -> str:
    """Pairs of links that may touch as an argument of the command, including pairs given before."""
    named = dict.fromkeys(tuple(sorted(pair)) for pair in (*(given or ()), *pairs))
    return setting("robot.may_touch", [*named])


def robot_settings(name: str, setup: Setup) -> str:
    """An arm's description and setup as arguments of the command."""
    return " ".join([setting("robot.name", name), *changes("robot", setup)])


def changes(group: str, settings: Any) -> list[str]:
    """Settings of a group that differ from their defaults, as arguments of the command."""
    plain = type(settings)()
    given = {name: x for name, x in vars(settings).items() if x != getattr(plain, name)}
    inner = {name: x for name, x in given.items() if is_dataclass(getattr(plain, name))}
    found = [changes(f"{group}.{name}", x) for name, x in inner.items()]
    own = [setting(f"{group}.{name}", x) for name, x in given.items() if name not in inner]
    return [*own, *chain(*found)]


def _plain(value: object, digits: str) -> str:
    """A value as written in settings; text is quoted if it could be read as something else."""
    if is_dataclass(value):  # instead of null
        value = {name: x for name, x in vars(value).items() if x is not None}
    match value:
        case None:
            return "null"
        case Mapping():
            named = {_RESERVED.sub(r"\\\g<0>", str(name)): _plain(x, digits) for name, x in value.items()}
            return f"{{{', '.join(': '.join(pair) for pair in named.items())}}}"
        case list() | tuple():
            return f"[{', '.join(_plain(x, digits) for x in value)}]"
        case bool():
            return str(value).lower()
        case int():
            return str(value)
        case float():
            return f"{value:.0f}" if value.is_integer() and abs(value) < _EXACT else f"{value:{digits}}"
    text = str(value)
    if _WORD.fullmatch(text) and text.lower() not in _NO_TEXT:
        return text
    literal = re.sub(r"(\\*)\$\{", r"\1\1\\${", text)  # no interpolation
    return '"' + re.sub(r'\\+(?="|\Z)', r"\g<0>\g<0>", literal).replace('"', r"\"") + '"'
