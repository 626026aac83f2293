"""Statements of a user about an arm, beside its description."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
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


def override(name: str, values: Mapping[str, object], given: object = None) -> str:
    """A setting of the robot by joint name as a word on the command line, with those that were given before.

    Args:
        name: of the setting within ``robot``.
        values: what is to be set.
        given: what the user has set already; by joint name, or it is replaced.
    """
    kept = given if isinstance(given, Mapping) else {}
    inner = ", ".join(f"{joint}: {_plain(value)}" for joint, value in {**kept, **values}.items())
    return f"'robot.{name}={{{inner}}}'"


def choice(name: str, value: str) -> str:
    """A setting of the robot as a word on the command line."""
    return quote(f"robot.{name}={_text(value)}")


def words(setup: Setup) -> list[str]:
    """A whole setup as words on the command line."""
    names = [field.name for field in fields(setup) if field.name != "limits"]
    given = [(name, getattr(setup, name)) for name in names if getattr(setup, name) != getattr(PLAIN, name)]
    given += [(f"limits.{field.name}", getattr(setup.limits, field.name)) for field in fields(Limits)]
    return [_word(name, value) for name, value in given if value is not None]


def allowed(pairs: Iterable[Sequence[str]], given: Iterable[Sequence[str]] | None = None) -> str:
    """Pairs of links that may touch as a word on the command line, with those that were given before."""
    together = dict.fromkeys(tuple(sorted(pair)) for pair in (*(given or ()), *pairs))
    return _word("may_touch", [*together])


def _word(name: str, value: object) -> str:
    """A setting of the robot as a word on the command line."""
    if isinstance(value, Mapping):
        return override(name, value)
    if isinstance(value, bool):
        return f"robot.{name}={str(value).lower()}"
    if isinstance(value, int | float):
        return f"robot.{name}={_plain(value)}"
    if isinstance(value, list | tuple):
        return quote(f"robot.{name}=[{', '.join(map(_plain, value))}]")
    return choice(name, str(value))


def _plain(value: object) -> str:
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_plain, value))}]"
    return f"{value:.6g}" if isinstance(value, int | float) else _text(str(value))


def _text(value: str) -> str:
    """Text as settings have it, in quotes where it would be read as a number or as nothing."""
    return value if _WORD.fullmatch(value) and value.lower() not in _NO_TEXT else f'"{value}"'
