"""Statements of a user about an arm, beside its description."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from shlex import quote
from typing import Any

from sidegan.base.typed import Number, Positive, Text

Mount = tuple[Number, Number, Number]


@dataclass(frozen=True)
class Limits:
    """Limits by joint name, or one number for all, before the description's; null: as it has them."""

    position: dict[str, tuple[Number, Number]] | Positive | None = None  # lower and upper, or ± [rad or m]
    velocity: dict[str, Positive] | Positive | None = None  # [rad/s or m/s]
    acceleration: dict[str, Positive] | Positive | None = None  # [rad/s² or m/s²]
    jerk: dict[str, Positive] | Positive | None = None  # [rad/s³ or m/s³]
    effort: dict[str, Positive] | Positive | None = None  # [N·m or N]
    file: str | None = None  # MoveIt's joint_limits.yaml, before which all of these go

    def of_joints(self, names: Iterable[str]) -> "Limits":
        """The same limits by the names of all joints."""
        every, changed = list(names), dict[str, Any]()
        for kind, value in vars(self).items():
            if isinstance(value, int | float):
                changed[kind] = dict.fromkeys(every, (-value, value) if kind == "position" else value)
        return replace(self, **changed)


@dataclass(frozen=True)
class Setup:
    """Which part of a description is the arm, where the rest stands, and what overrides its limits."""

    args: dict[str, Text] | None = None  # arguments of a xacro file
    tip: str | None = None  # link up to which joints move; null: the end of the only chain
    locked: dict[str, Number] | None = None  # where joints stand that do not move [rad or m]
    # roll, pitch and yaw [rad] of the first link in a world whose z points up; null: upright, or as gravity
    # acts in an MJCF
    mount: Mount | None = None
    limits: Limits = Limits()
    may_touch: list[tuple[str, str]] | None = None  # links that are not kept apart
    friction: bool = True  # whether friction and rotors of the description count in torques


PLAIN = Setup()
_WORD = re.compile(r"…|[A-Za-z_/.~][\w/.~-]*")
_NO_TEXT = {"null", "true", "false", "yes", "no", "on", "off", "nan", "inf"}


def setting(name: str, value: object) -> str:
    """A setting within ``robot`` as a word on the command line."""
    return quote(f"robot.{name}={_plain(value)}")


def override(name: str, values: Mapping[str, object], given: object = None) -> str:
    """A setting by joint name as a word on the command line, with those joints' that were given before."""
    return setting(name, {**(given if isinstance(given, Mapping) else {}), **values})


def allowed(pairs: Iterable[Sequence[str]], given: Iterable[Sequence[str]] | None = None) -> str:
    """Pairs of links that may touch as a word on the command line, with those that were given before."""
    return setting("may_touch", [*dict.fromkeys(tuple(sorted(pair)) for pair in (*(given or ()), *pairs))])


def words(setup: Setup) -> list[str]:
    """A whole setup as words on the command line."""
    given = {name: x for name, x in vars(setup).items() if name != "limits" and x != getattr(PLAIN, name)}
    given |= {f"limits.{name}": x for name, x in vars(setup.limits).items()}
    return [setting(name, x) for name, x in given.items() if x is not None]


def _plain(value: object) -> str:
    """A value as settings have it; text in quotes where it would be read as a number or as nothing."""
    match value:
        case Mapping():
            return f"{{{', '.join(f'{name}: {_plain(x)}' for name, x in value.items())}}}"
        case list() | tuple():
            return f"[{', '.join(map(_plain, value))}]"
        case bool():
            return str(value).lower()
        case int() | float():
            return f"{value:.6g}"
    text = str(value)
    return text if _WORD.fullmatch(text) and text.lower() not in _NO_TEXT else f'"{text}"'
