"""Units of a file's columns: as configured, else as in the column names, else SI."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.errors import RecordingError

_DEGREE, _TURN = math.pi / 180, 2 * math.pi
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # of a unit of time
_TO_SI = {
    "time": SECONDS,
    "angle": {"rad": 1.0, "deg": _DEGREE, "rpm": _TURN / 60},
    "length": {"m": 1.0, "mm": 1e-3},
    "torque": {"N·m": 1.0, "Nm": 1.0, "mNm": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3},
}
_SPELT = {  # lower-case spellings of units other than SI
    "time": {
        **dict.fromkeys(("ms", "msec", "msecs", "millis", "milliseconds"), "ms"),
        **dict.fromkeys(("us", "µs", "μs", "usec", "usecs", "micros", "microseconds"), "us"),
        **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanos", "nanoseconds"), "ns"),
    },
    "angle": {**dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), "deg"), "rpm": "rpm"},
    "length": {"mm": "mm"},
    "torque": {"mnm": "mNm", "nmm": "mNm", "mm": "mNm"},  # N·mm
    "current": {"ma": "mA"},
}
_RATED = re.compile(r".[%‰]|percent|pct|per_?mille")
_ENDS = {"rad", "m", "nm", "n", "a", *(word for words in _SPELT.values() for word in words)}
SPELT_TIMES = frozenset(_SPELT["time"]) | {"s", "sec", "secs", "second", "seconds"}


@dataclass(frozen=True)
class Counts:
    """Positions in encoder counts: a value for all joints, or one per joint."""

    per_turn: float | list[float]  # or per metre of a prismatic joint; negative if counted backwards
    zero: float | list[float] = 0.0  # reading at joint position zero

    def in_si(self, counts: Array, slides: Sequence[bool]) -> Array:
        """Positions [rad or m], (S, J), from counts (S, J)."""
        found = []
        for name, values in vars(self).items():
            if np.ndim(values) and len(np.atleast_1d(values)) != len(slides):
                raise RecordingError(
                    f"recording.units.position.{name} has {counted(len(np.atleast_1d(values)), 'value')}, "
                    f"the arm has {len(slides)}"
                )
            found.append(np.asarray(values, dtype=np.float64))
        per_turn, zero = found
        return (counts - zero) / per_turn * np.where(slides, 1.0, _TURN)


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of a file's columns; null: as in the column names (``q1 [deg]``), or else SI.

    Velocity and acceleration are in ``angle``, or ``length`` for prismatic joints, per second and second².
    """

    time: Literal["s", "ms", "us", "ns"] | None = None
    angle: Literal["rad", "deg"] | None = None
    length: Literal["m", "mm"] | None = None
    torque: Literal["N·m", "Nm", "mNm"] | None = None
    current: Literal["A", "mA"] | None = None
    position: Counts | None = None  # null: positions are in ``angle`` and ``length``

    def factor(self, signal: str, slides: bool = False, heading: str = "") -> float:
        """Factor from a joint's signal, or ``"time"``, to SI units."""
        kind = _kind(signal, slides)
        return _TO_SI[kind].get(getattr(self, kind) or _headed(kind, heading), 1.0)

    def refuse_rated(self, file: str, signal: str, slides: bool, heading: str) -> None:
        """Refuse a column in per cent or per mille of a rated value, unless a unit is configured."""
        kind = _kind(signal, slides)
        if getattr(self, kind) or not _RATED.search(heading.lower()):
            return
        unit = next(iter(_TO_SI[kind]))
        raise RecordingError(
            f"{file}: {heading!r} is a share of a rated value, which is unknown: convert the column to "
            f"{unit} and rename it; if it is in {unit} already: recording.units.{kind}={unit}"
        )

    def read(self, signal: str, slides: bool, heading: str) -> str:
        """The non-SI unit in a column's name; empty if there is none or a unit is configured."""
        kind = _kind(signal, slides)
        return "" if getattr(self, kind) else _headed(kind, heading)


def _kind(signal: str, slides: bool) -> str:
    if signal in ("time", "torque", "current"):
        return signal
    return "length" if slides else "angle"


def _headed(kind: str, heading: str) -> str:
    """The last unit of a kind in a heading; empty if there is none, or SI."""
    words = re.findall(r"[a-zµμ°]+", heading.lower())
    return next((_SPELT[kind][word] for word in reversed(words) if word in _SPELT[kind]), "")


def without_unit(text: str) -> str:
    """The end of a heading without its unit: ``" Pos"`` for ``" Pos (deg)"``, empty for ``"_rad"``."""
    name, _, last = text.rpartition("_")
    return name if last.lower() in _ENDS else re.sub(r"\s*[(\[][^\d)\]]+[)\]]\s*$", "", text)
