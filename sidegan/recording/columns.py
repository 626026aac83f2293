"""Which column of a file is which signal of which joint, and in which unit."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from sidegan.errors import ConfigError, RecordingError
from sidegan.recording.recording import SIGNALS

ANGLES = {"rad": 1.0, "deg": math.pi / 180}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
TORQUES = {"N·m": 1.0, "Nm": 1.0, "mNm": 1e-3}
CURRENTS = {"A": 1.0, "mA": 1e-3}

_PLACE = re.compile(r"\{(joint|index|index0)\}")
Mapping = str | Sequence[str] | None


@dataclass(frozen=True)
class Units:
    """Units of what a file holds.

    Raises:
        ConfigError: when a unit is unknown.
    """

    time: str = "s"
    angle: str = "rad"  # velocity and acceleration: the same per second and per second squared
    torque: str = "N·m"
    current: str = "A"

    def __post_init__(self) -> None:
        for name, known in (("time", TIMES), ("angle", ANGLES), ("torque", TORQUES), ("current", CURRENTS)):
            if getattr(self, name) not in known:
                expected = ", ".join(known)
                raise ConfigError(f"unit of {name} is {getattr(self, name)!r}, expected {expected}")

    def factor(self, signal: str) -> float:
        """What a signal, or ``"time"``, is multiplied with to be in SI units."""
        if signal == "time":
            return TIMES[self.time]
        if signal == "torque":
            return TORQUES[self.torque]
        return CURRENTS[self.current] if signal == "current" else ANGLES[self.angle]


@dataclass(frozen=True)
class Columns:
    """Where a file keeps time and signals.

    A signal is a pattern with ``{joint}`` (the joint's name), ``{index}`` (from 1) or ``{index0}`` (from
    0), a list of columns in the arm's order, or the name of one array (S, J). Position has to be
    there; of the others, what a file does not have is left out, but a signal of some joints only is refused.

    Attributes:
        time: column of time stamps.
        position: of joint positions; so on for the others.
        units: of all of them.
        joints: the names that the file uses, in the arm's order; None: the arm's own.
        topic: of a bag; None: the only topic of joint states.
        effort: what the efforts of a bag's joint states are.
    """

    time: str = "t"
    position: Mapping = "q{index}"
    velocity: Mapping = "qd{index}"
    acceleration: Mapping = "qdd{index}"
    torque: Mapping = "tau{index}"
    current: Mapping = "i{index}"
    units: Units = field(default_factory=Units)
    joints: Sequence[str] | None = None
    topic: str | None = None
    effort: str = "torque"

    def __post_init__(self) -> None:
        if self.position is None:
            raise ConfigError("columns.position is not set: positions are needed")
        if self.effort not in ("torque", "current"):
            raise ConfigError(f"effort is {self.effort!r}, expected 'torque' or 'current'")

    def file_joints(self, name: str, joint_names: Sequence[str]) -> tuple[str, ...]:
        """What the file calls the arm's joints.

        Raises:
            RecordingError: when the names given are not as many as the arm's joints.
        """
        if self.joints is None:
            return tuple(joint_names)
        if len(self.joints) != len(joint_names):
            raise RecordingError(
                f"{name}: {len(self.joints)} joint names are given, the arm has {len(joint_names)}: "
                f"{', '.join(joint_names)}"
            )
        return tuple(self.joints)

    def resolve(
        self, name: str, available: Sequence[str], joint_names: Sequence[str]
    ) -> dict[str, list[str]]:
        """Columns of time and of every signal that is there; one column is an array (S, J).

        Args:
            name: of the file, for complaints.
            available: columns that the file has.
            joint_names: of the arm.

        Raises:
            RecordingError: when time or positions are missing, a signal is incomplete, or the file has
                another number of joints than the arm.
        """
        if self.time not in available:
            raise RecordingError(
                f"{name} has no column {self.time!r} of time stamps; it has {_some(available)}"
            )
        names = self.file_joints(name, joint_names)
        found = {"time": [self.time]}
        for signal in SIGNALS:
            columns = _columns(getattr(self, signal), names)
            missing = [c for c in columns if c not in available]
            if columns and not missing:
                _refuse_more(name, signal, getattr(self, signal), available, len(names))
                found[signal] = columns
            elif missing and (signal == "position" or len(missing) < len(columns)):
                raise RecordingError(
                    f"{name} has no {signal} of {len(missing)} of the arm's {len(names)} joints: no column "
                    f"{_some(missing)}; it has {_some(available)}"
                )
        return found


def _columns(mapping: Mapping, names: Sequence[str]) -> list[str]:
    """The columns of a signal for joints of these names."""
    if mapping is None:
        return []
    if not isinstance(mapping, str):
        return list(mapping)
    if not _PLACE.search(mapping):
        return [mapping]
    return [mapping.format(joint=joint, index=i + 1, index0=i) for i, joint in enumerate(names)]


def _refuse_more(name: str, signal: str, mapping: Mapping, available: Sequence[str], joints: int) -> None:
    """Raise when a numbered signal goes on after the arm's last joint, or a list does not fit the arm."""
    if isinstance(mapping, str) and ("{index}" in mapping or "{index0}" in mapping):
        following = mapping.format(joint="", index=joints + 1, index0=joints)
        if following in available:
            raise RecordingError(f"{name} has {following}: {signal} of more than the arm's {joints} joints")
    elif not isinstance(mapping, str) and mapping is not None and len(mapping) != joints:
        raise RecordingError(
            f"{name}: columns.{signal} lists {len(mapping)} columns, the arm has {joints} joints"
        )


def _some(names: Sequence[str], most: int = 8) -> str:
    shown = ", ".join(repr(str(n)) for n in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "") if names else "none"
