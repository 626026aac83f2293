"""Units of a file's columns: as configured, else as in the column names, else SI."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.errors import RecordingError

_DEGREE, _TURN = math.pi / 180, 2 * math.pi
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # of a unit of time
_TO_SI = {  # units of the settings
    "time": SECONDS,
    "angle": {"rad": 1.0, "deg": _DEGREE, "rpm": _TURN / 60},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "torque": {"N·m": 1.0, "Nm": 1.0, "mNm": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3},
}
_SPELT = {  # lower-case spellings of these units other than SI, as words of a heading
    "time": {
        **dict.fromkeys(("ms", "msec", "msecs", "millis", "milliseconds"), "ms"),
        **dict.fromkeys(("us", "µs", "μs", "usec", "usecs", "micros", "microseconds"), "us"),
        **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanos", "nanoseconds"), "ns"),
    },
    "angle": {**dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), "deg"), "rpm": "rpm"},
    "length": {"mm": "mm", "cm": "cm"},
    "torque": {"mnm": "mNm", "nmm": "mNm", "mm": "mNm"},  # N·mm
    "current": {"ma": "mA"},
}
_POUND, _KILOGRAM = 4.4482216152605, 9.80665  # [N] weights
_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "inch": 0.0254, "ft": 0.3048}
_FORCES = {
    **{"n": 1.0, "mn": 1e-3, "cn": 1e-2, "dan": 10.0, "kn": 1e3, "g": _KILOGRAM / 1e3, "gf": _KILOGRAM / 1e3},
    **dict.fromkeys(("kg", "kgf"), _KILOGRAM),
    **dict.fromkeys(("lb", "lbs", "lbf"), _POUND),
    **dict.fromkeys(("oz", "ozf"), _POUND / 16),
}
_PAIRS = [(f, d, _FORCES[f] * _LENGTHS[d]) for f, d in product(_FORCES, _LENGTHS)]
_STATED = {  # other units that headings state, lower-case letters only
    "time": {},
    "angle": {
        **{"mrad": 1e-3, "deg": _DEGREE, "mdeg": _DEGREE / 1e3, "gon": _TURN / 400, "dps": _DEGREE},
        **dict.fromkeys(("rev", "revs", "turn", "turns", "rps"), _TURN),
    },
    "length": _LENGTHS,
    "torque": {d + f: x for f, d, x in _PAIRS} | {f + d: x for f, d, x in _PAIRS},
    "current": {"ua": 1e-6, "µa": 1e-6, "ka": 1e3},
}
_EXAMPLES = {  # for people
    "angle": "rad, mrad, deg, gon, rev",
    "length": "m, cm, mm, in, ft",
    "torque": "N·m, mNm, N·cm, kN·m, kgf·m, lbf·ft, lbf·in, oz·in",
    "current": "A, mA",
}
_IN_NAMES = {"rev", "revs", "turn", "turns"}  # names of joints may end like this: units in brackets only
_BRACKETED = re.compile(r"[(\[]([^()\[\]]*)[)\]]")
_PER_SECOND = re.compile(r"(per)?s(ec)?[12]?$")
_ELSE = re.compile(r"[mµuk]A(rms)?|[mk]?V|[Gg]rad|Hz")  # of other signals, or, as grad, ambiguous
_RATED = re.compile(r".[%‰]|percent|pct|per_?mille")
_ENDS = {"rad", "m", "nm", "n", "a", *(word for words in _SPELT.values() for word in words)}
_ENDS |= {word for words in _STATED.values() for word in words if len(word) > 2} - _IN_NAMES
SPELT_TIMES = frozenset(_SPELT["time"]) | {"s", "sec", "secs", "second", "seconds"}
_WORDS = {*_ENDS, *SPELT_TIMES, *(word for words in _STATED.values() for word in words)}


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
        return _TO_SI[kind].get(getattr(self, kind)) or _headed(kind, slides, heading)[1]

    def refuse_unknown(self, file: str, signal: str, slides: bool, heading: str) -> None:
        """Refuse a column in another unit than its signal's, such as per cent, unless one is configured."""
        kind = _kind(signal, slides)
        unit = next(iter(_TO_SI[kind]))
        if getattr(self, kind):
            return
        if _RATED.search(heading.lower()):
            raise RecordingError(
                f"{file}: {heading!r} is a share of a rated value, which is unknown: convert the column to "
                f"{unit} and rename it; if it is in {unit} already: recording.units.{kind}={unit}"
            )
        if not _headed(kind, slides, heading)[0] and (other := _other(heading)):
            raise RecordingError(
                f"{file}: {heading!r} states {other!r}, which is no known unit of its {signal} (known are "
                f"{_EXAMPLES[kind]}): convert the column to {unit} and rename it; if it is in {unit} "
                f"already: recording.units.{kind}={unit}"
            )

    def read(self, signal: str, slides: bool, heading: str) -> str:
        """The non-SI unit in a column's name; empty if there is none or a unit is configured."""
        kind = _kind(signal, slides)
        name, factor = ("", 1.0) if getattr(self, kind) else _headed(kind, slides, heading)
        return "" if factor == 1 else name


def _kind(signal: str, slides: bool) -> str:
    if signal in ("time", "torque", "current"):
        return signal
    return "length" if slides else "angle"


def _headed(kind: str, slides: bool, heading: str) -> tuple[str, float]:
    """The last unit of a kind in a heading, and its factor to SI units; empty and 1 if there is none."""
    stated = _STATED[kind] | (_FORCES if slides and kind == "torque" else {})
    ends = [" ".join(re.split(r"[_\s]+", heading)[-n:]) for n in (1, 2)]
    for text in [*reversed(_BRACKETED.findall(heading)), *ends]:
        whole = _letters(text)
        for word in (whole, _PER_SECOND.sub("", whole)):
            if word in stated and (text not in ends or (len(word) > 2 and word not in _IN_NAMES)):
                name = _SPELT[kind].get(word, text.strip())
                return name, stated[word]
    words = re.findall(r"[a-zµμ°]+", heading.lower())
    name = next((_SPELT[kind][word] for word in reversed(words) if word in _SPELT[kind]), "")
    return name, _TO_SI[kind].get(name, 1.0)


def _letters(text: str) -> str:
    """Lower-case letters and digits of a unit: ``"ncm"`` for ``"N·cm"``."""
    return re.sub(r"[^a-zµ°0-9]", "", text.lower().replace("²", "2"))


def _other(heading: str) -> str:
    """Text in brackets that is a unit of some other signal, or ambiguous; empty if there is none."""
    for text in map(str.strip, _BRACKETED.findall(heading)):
        word = _letters(text)
        force = len(word) > 1 and word in _FORCES
        if force or word in _STATED["torque"] or _ELSE.fullmatch(text):
            return text
    return ""


def are_units(texts: Sequence[str]) -> bool:
    """Whether texts are units, most of them known, none of them a number; some may be empty."""
    words = [_letters(text) for text in texts if _letters(text)]
    known = [word for word in words if word in _WORDS or _PER_SECOND.sub("", word) in _WORDS]
    return 2 * len(known) > len(words)


def without_unit(text: str) -> str:
    """The end of a heading without its unit: ``" Pos"`` for ``" Pos (deg)"``, empty for ``"_rad"``."""
    name, _, last = text.rpartition("_")
    return name if last.lower() in _ENDS else re.sub(r"\s*[(\[][^\d)\]]+[)\]]\s*$", "", text)
