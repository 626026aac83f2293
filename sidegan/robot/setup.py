"""A user's settings of an arm, in addition to its description."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from sidegan.base.typed import Number, Positive, Text

Mount = tuple[Number, Number, Number]


@dataclass(frozen=True)
class Limits:
    """Limits by joint name, or one number for all joints; they override the description's unless null."""

    position: dict[str, tuple[Number, Number]] | Positive | None = None  # lower and upper, or ± [rad or m]
    velocity: dict[str, Positive] | Positive | None = None  # [rad/s or m/s]
    acceleration: dict[str, Positive] | Positive | None = None  # [rad/s² or m/s²]
    jerk: dict[str, Positive] | Positive | None = None  # [rad/s³ or m/s³]
    effort: dict[str, Positive] | Positive | None = None  # [N·m or N]
    file: str | None = None  # MoveIt's joint_limits.yaml, which all of these override

    def of_joints(self, names: Iterable[str]) -> "Limits":
        """The same limits, with single numbers expanded to all joints."""
        joints = list(names)
        changed: dict[str, Any] = {}
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
