"""Units of a file's columns: as configured, else as in the column names, else SI."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.base.settings_text import suggestion
from sidegan.errors import ConfigError, RecordingError

_DEGREE, _TURN = math.pi / 180, 2 * math.pi
_POUND, _KILOGRAM = 4.4482216152605, 9.80665  # [N] weights
SECONDS = {  # in a unit of time
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "usecs", "micros", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanos", "nanoseconds"), 1e-9),
}
_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "inch": 0.0254, "ft": 0.3048}
_FORCES = {
    **{"n": 1.0, "mn": 1e-3, "cn": 1e-2, "dan": 10.0, "kn": 1e3, "g": _KILOGRAM / 1e3, "gf": _KILOGRAM / 1e3},
    **dict.fromkeys(("kg", "kgf"), _KILOGRAM),
    **dict.fromkeys(("lb", "lbs", "lbf"), _POUND),
    **dict.fromkeys(("oz", "ozf"), _POUND / 16),
}
_PAIRS = [(f, d, _FORCES[f] * _LENGTHS[d]) for f, d in product(_FORCES, _LENGTHS)]
_UNITS = {  # factors to SI units, whose unit is the first; lower-case letters only, without "per second"
    "time": SECONDS,
    "angle": {
        **{"rad": 1.0, "mrad": 1e-3, "mdeg": _DEGREE / 1e3, "gon": _TURN / 400, "rpm": _TURN / 60},
        **dict.fromkeys(("deg", "degs", "degree", "degrees", "°", "dps"), _DEGREE),
        **dict.fromkeys(("rev", "revs", "turn", "turns", "rps"), _TURN),
    },
    "length": _LENGTHS,
    "torque": {f + d: x for f, d, x in _PAIRS} | {d + f: x for f, d, x in _PAIRS},
    "current": {"a": 1.0, "ma": 1e-3, "ua": 1e-6, "µa": 1e-6, "ka": 1e3},
}
_EXAMPLES = {  # for people
    "angle": "rad, mrad, deg, gon, rev",
    "length": "m, cm, mm, in, ft",
    "torque": "N·m, mNm, N·cm, kN·m, kgf·m, lbf·ft, lbf·in, oz·in",
    "force": "N, mN, kN, kgf, lbf",
    "current": "A, mA",
}
_WORDS = {*_FORCES, *(word for words in _UNITS.values() for word in words)}
# words that are units without brackets, too; names of joints may end in rev or turn
_SHORT = {"m", "mm", "cm", "n", "nm", "a", "ma", "ms", "us", "µs", "μs", "ns", "°"}
_CLEAR = {word for word in _WORDS if len(word) > 2 or word in _SHORT} - {"rev", "revs", "turn", "turns"}
_BRACKETED = re.compile(r"[(\[]([^()\[\]]*)[)\]]")
_PER_SECOND = re.compile(r"(per)?s(ec)?[12]?$")
_ELSE = re.compile(r"[mµuk]A(rms)?|[mk]?V|[Gg]rad|Hz")  # of other signals, or, as grad, ambiguous
_RATED = re.compile(r".[%‰]|percent|pct|per_?mille")


@dataclass(frozen=True)
class Counts:
    """Positions in encoder counts: a value for all joints, or one per joint."""

    per_turn: float | list[float]  # or per metre of a prismatic joint; negative if counted backwards
    zero: float | list[float] = 0.0  # reading at joint position zero

    def __post_init__(self) -> None:
        if not np.all(self.per_turn):
            raise ConfigError(f"per_turn is {self.per_turn}, expected none to be zero")

    def in_si(self, counts: Array, slides: Sequence[bool]) -> Array:
        """Positions [rad or m], (S, J), from counts (S, J)."""
        for name, values in vars(self).items():
            if isinstance(values, list) and len(values) != len(slides):
                raise RecordingError(
                    f"recording.units.position.{name} has {counted(len(values), 'value')}, the arm has "
                    f"{counted(len(slides), 'joint')}"
                )
        turns = (counts - np.asarray(self.zero)) / np.asarray(self.per_turn)
        return turns * np.where(slides, 1.0, _TURN)


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

    def with_stated(self, stated: Mapping[str, str]) -> "Units":
        """These units with those that headings state, by kind: ``{"angle": "deg"}``."""
        known = {kind: _letters(unit) for kind, unit in stated.items() if _letters(unit) in _UNITS[kind]}
        return replace(self, **known)  # type: ignore[arg-type]

    def setting(self, factor: Array, zero: Array, slides: Array) -> str:
        """The setting that makes positions ``factor`` times what they are now, plus ``zero``, (J,) each."""
        turn = np.where(slides, 1.0, _TURN)
        now = np.where(slides, _UNITS["length"][self.length or "m"], _UNITS["angle"][self.angle or "rad"])
        counts = self.position or Counts((turn / now).tolist())
        per_turn = np.asarray(counts.per_turn) / factor
        fields: dict[str, float | list[float]] = {}
        for name, values in (("per_turn", per_turn), ("zero", counts.zero - zero * per_turn / turn)):
            each = [float(f"{x:.5g}") for x in np.broadcast_to(values, factor.shape) + 0.0]
            fields[name] = each[0] if len({*each}) == 1 else each
        return suggestion("recording.units.position", fields, "g")

    def of(self, file: str, signal: str, slides: bool, heading: str) -> tuple[str, float]:
        """Unit in the heading of a joint's signal, or of ``"time"``, and the factor to SI units.

        The unit is empty if it is configured, SI, or not stated. Another unit than the signal's is refused.
        """
        angle = "length" if slides else "angle"
        kind = signal if signal in ("time", "torque", "current") else angle
        if configured := getattr(self, kind):
            return "", _UNITS[kind][_letters(configured)]
        known = _UNITS[kind]
        if kind == "torque":
            known = known | {"mm": 1e-3} | (_FORCES if slides else {})  # the end of N·mm
        unit, factor = _stated(heading, known)
        if kind != "time":
            _refuse_other(file, signal, "force" if slides and kind == "torque" else kind, heading, unit)
        return "" if factor == 1 else unit, factor


def _refuse_other(file: str, signal: str, kind: str, heading: str, unit: str) -> None:
    """Refuse a heading in which another unit than the signal's stands, such as per cent."""
    examples = _EXAMPLES[kind]
    si = examples.partition(",")[0]
    setting = "torque" if kind == "force" else kind
    as_set = suggestion(f"recording.units.{setting}", _EXAMPLES[setting].partition(",")[0])
    already = f"if it is in {si} already: {as_set}"
    if _RATED.search(heading.lower()):
        raise RecordingError(
            f"{file}: {heading!r} is a share of a rated value, which is unknown: convert the column to {si} "
            f"and rename it; {already}"
        )
    if not unit and (other := _other(heading)):
        raise RecordingError(
            f"{file}: {heading!r} states {other!r}, which is no known unit of its {signal} (known are "
            f"{examples}): convert the column to {si} and rename it; {already}"
        )


def _stated(heading: str, known: Mapping[str, float]) -> tuple[str, float]:
    """The last of the known units in a heading, and its factor; empty and 1 if there is none.

    Units in brackets precede others.
    """
    words = re.split(r"[_\s]+", heading)
    loose = [" ".join(words[-2:]), *words[::-1], *re.findall(r"[a-zµμ°]+", heading.lower())[::-1]]
    for bracketed, texts in ((True, _BRACKETED.findall(heading)[::-1]), (False, loose)):
        for text in texts:
            whole = _letters(text)
            for word in (whole, _PER_SECOND.sub("", whole)):
                if word in known and (bracketed or (word in _CLEAR and known[word] != 1)):
                    return text.strip(), known[word]
    return "", 1.0


def _letters(text: str) -> str:
    """Lower-case letters and digits of a unit: ``"ncm"`` for ``"N·cm"``."""
    return re.sub(r"[^a-zµ°0-9]", "", text.lower().replace("²", "2").replace("μ", "µ"))


def _other(heading: str) -> str:
    """Text in brackets that is a unit of some other signal, or ambiguous; empty if there is none."""
    for text in map(str.strip, _BRACKETED.findall(heading)):
        word = _letters(text)
        force = len(word) > 1 and word in _FORCES
        if force or word in _UNITS["torque"] or _ELSE.fullmatch(text):
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
    return name if last.lower() in _CLEAR else re.sub(r"\s*[(\[][^\d)\]]+[)\]]\s*$", "", text)
