"""Group ``recording`` of ``conf/``: where a file keeps what, in which units, and how it is preprocessed."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from sidegan.base.typed import Bound, Hertz, NonNegative, Positive, Seconds
from sidegan.errors import ConfigError, RecordingError

SIGNALS = ("position", "velocity", "acceleration", "torque", "current")
_TO_SI = {
    **{"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    **{"rad": 1.0, "deg": math.pi / 180},
    **{"N·m": 1.0, "Nm": 1.0, "mNm": 1e-3},
    **{"A": 1.0, "mA": 1e-3},
}
_PLACEHOLDER = re.compile(r"\{(joint|index|index0)\}")
_OR = "|"  # between patterns
_BRIDGED = 0.25  # of the cut-off's period
_LISTED = 8  # columns that a message names


@dataclass(frozen=True)
class Units:
    """Units of what a file holds; velocity and acceleration are in ``angle`` per second and second²."""

    time: Literal["s", "ms", "us", "ns"]
    angle: Literal["rad", "deg"]
    torque: Literal["N·m", "Nm", "mNm"]
    current: Literal["A", "mA"]

    def factor(self, signal: str) -> float:
        """Factor that brings a signal, or ``"time"``, to SI units."""
        return _TO_SI[getattr(self, signal if signal in ("time", "torque", "current") else "angle")]


@dataclass(frozen=True)
class Columns:
    """Where a file keeps time and signals.

    A signal is a pattern with ``{joint}`` (the joint's name), ``{index}`` (from 1) or ``{index0}`` (from
    0), or the name of one array (S, J); patterns between bars are tried one after another. Position has to be
    there; of the others, what a file does not have is left out, but a signal of some joints only is refused.
    """

    time: str
    position: str
    velocity: str | None
    acceleration: str | None
    torque: str | None
    current: str | None
    units: Units
    joints: list[str] | None  # names that the file uses, in the arm's order; null: the arm's own
    topic: str | None  # of a bag; null: the only topic of joint states
    effort: Literal["torque", "current"]  # what the efforts of a bag's joint states are
    rate: Hertz | None  # of the rows [Hz] of a file without time stamps
    # columns, or patterns of all joints' columns, of a text without a first line of them
    header: list[str] | None

    def __post_init__(self) -> None:
        for signal in SIGNALS:
            pattern = getattr(self, signal)
            if pattern is not None and re.search(r"[{}]", _PLACEHOLDER.sub("", pattern)):
                raise ConfigError(
                    f"{signal} is {pattern!r}, expected no braces but {{joint}}, {{index}} and {{index0}}"
                )

    def file_joints(self, file: str, joint_names: Sequence[str]) -> tuple[str, ...]:
        """Names of the arm's joints in the file.

        Raises:
            RecordingError: when the configured names are not as many as the arm's joints.
        """
        if self.joints is None:
            return tuple(joint_names)
        if len(self.joints) != len(joint_names):
            raise RecordingError(
                f"{file}: {len(self.joints)} joint names are given, the arm has {len(joint_names)}: "
                f"{', '.join(joint_names)}"
            )
        return tuple(self.joints)

    def named(self, file: str, joint_names: Sequence[str]) -> list[str] | None:
        """Names of the columns of a text without a first line of them, where they were given."""
        if self.header is None:
            return None
        joints = self.file_joints(file, joint_names)
        return [name for pattern in self.header for name in _columns(pattern, joints)]

    def resolve(
        self, file: str, available: Sequence[str], joint_names: Sequence[str]
    ) -> dict[str, list[str]]:
        """Columns of time and of every signal that a file has; a single column is an array (S, J).

        Raises:
            RecordingError: when time or positions are missing, a signal is incomplete, or the file has
                another number of joints than the arm.
        """
        stamps = [name for name in self.time.split(_OR) if name in available]
        if not stamps and self.rate is None:
            wanted = " or ".join(map(repr, self.time.split(_OR)))
            raise RecordingError(
                f"{file} has no column {wanted} of time stamps; it has {_listed(available)}; without a clock "
                "say how many rows there are in a second: recording.rate=1000"
            )
        _refuse_several(file, "time", stamps)
        joints = self.file_joints(file, joint_names)
        resolved = {"time": stamps} if stamps else {}
        for signal in SIGNALS:
            columns = _found(file, signal, getattr(self, signal), joints, available)
            if columns:
                resolved[signal] = columns
        return resolved


@dataclass(frozen=True)
class Preprocessing:
    """How a recording becomes filtered segments on a uniform grid."""

    reverse: list[str]  # joints whose torque or current is counted the other way round
    bandwidth: Hertz | None  # highest frequency of the executed trajectory [Hz]; null: measured
    cutoff: Hertz | None  # of the zero-phase low-pass [Hz]; null: headroom × bandwidth
    headroom: Positive  # cut-off over bandwidth
    # of the low-pass, which is run forwards and backwards; beyond, its coefficients are rounding errors
    order: Annotated[int, Bound("≥", 1), Bound("≤", 20)]
    oversampling: Annotated[float, Bound(">", 2)]  # samples that are kept per period of the cut-off
    # longest time that is interpolated over [s]; null: five samples, or a quarter of the cut-off's period
    gap: Seconds | None
    still: NonNegative  # below it a joint rests [rad/s or m/s]; 0 keeps all samples
    pause: Annotated[float, Bound("≥", 0), Bound("≤", 1e3)]  # samples this close to a motion are kept [s]

    def cutoff_of(self, bandwidth: float) -> float:
        """Cut-off of the low-pass [Hz] for a motion of a measured bandwidth [Hz]."""
        return self.cutoff or self.headroom * (self.bandwidth or bandwidth)

    def bridged(self, bandwidth: float) -> float:
        """Time that may be interpolated over [s] where the motion has a bandwidth [Hz]."""
        return _BRIDGED / self.cutoff_of(bandwidth)


@dataclass(frozen=True)
class RecordingSettings(Preprocessing, Columns):
    """What is where in a recorded file, what is known of its making, and how it is preprocessed."""

    # time by which torques are later than states [s], which is taken off; null: measured
    delay: Annotated[float, Bound("≥", -0.5), Bound("≤", 0.5)] | None
    # what was sent to the arm: a table of excite, or the folder of its run; null: not known
    sent: str | None
    rows: Annotated[int, Bound("≥", 1000), Bound("≤", 1e7)]  # that are read at once


def _found(
    file: str, signal: str, patterns: str | None, joints: Sequence[str], available: Sequence[str]
) -> list[str]:
    """Columns of a signal in a file, one per joint, or the one array of all joints; [] when it has none.

    Raises:
        RecordingError: when it has them for some joints or more than the arm's, in two ways, or no positions.
    """
    every = {pattern: _columns(pattern, joints) for pattern in patterns.split(_OR)} if patterns else {}
    whole = [pattern for pattern, columns in every.items() if set(columns) <= set(available)]
    _refuse_several(file, signal, whole)
    if whole:
        _refuse_more_joints(file, signal, whole[0], available, len(joints))
        return every[whole[0]]
    if not every:
        return []
    there = {pattern: sum(c in available for c in columns) for pattern, columns in every.items()}
    nearest = every[max(there, key=lambda pattern: there[pattern])]
    missing = [c for c in nearest if c not in available]
    if signal == "position" or len(missing) < len(nearest):
        raise RecordingError(
            f"{file} has no {signal} of {len(missing)} of the arm's {len(joints)} joints: no column "
            f"{_listed(missing)}; it has {_listed(available)}"
        )
    return []


def _columns(pattern: str, joints: Sequence[str]) -> list[str]:
    """Columns of a signal, one per joint, or the one array of all joints."""
    if not _PLACEHOLDER.search(pattern):
        return [pattern]
    return [_filled(pattern, joint, i) for i, joint in enumerate(joints)]


def _filled(pattern: str, joint: str, number: int) -> str:
    """A pattern for one joint, counted from 0."""
    values = {"joint": joint, "index": str(number + 1), "index0": str(number)}
    return _PLACEHOLDER.sub(lambda match: values[match[1]], pattern)


def _refuse_more_joints(file: str, signal: str, pattern: str, available: Sequence[str], joints: int) -> None:
    """Raise when a numbered signal goes on after the arm's last joint."""
    following = _filled(pattern, "", joints)
    if "{index" in pattern and following in available:
        raise RecordingError(f"{file} has {following}: {signal} of more than the arm's {joints} joints")


def _refuse_several(file: str, signal: str, patterns: Sequence[str]) -> None:
    """Raise when a file has a signal in more than one way, between which nothing decides."""
    if len(patterns) > 1:
        ways = " and as ".join(map(repr, patterns))
        raise RecordingError(
            f"{file} has {signal} as {ways}; say which is meant: recording.{signal}='{patterns[0]}'"
        )


def _listed(columns: Sequence[str]) -> str:
    shown = ", ".join(repr(str(c)) for c in columns[:_LISTED])
    more = len(columns) - _LISTED
    return (shown + (f" and {more} more" if more > 0 else "")) or "none"
