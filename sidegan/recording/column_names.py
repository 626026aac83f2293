"""Which signals columns hold, judged by their names, in all usual conventions."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, permutations

from sidegan.recording.units import SECONDS, without_unit

_CALLED = {
    "position": ["q", "qpos", "pos", "position", "positions", "angle", "angles"],
    "velocity": ["qd", "dq", "dot", "qdot", "qvel", "vel", "velocity", "velocities", "speed", "speeds"],
    "acceleration": ["qdd", "ddq", "ddot", "qddot", "qacc", "acc", "accel", "acceleration", "accelerations"],
    "torque": ["tau", "trq", "torque", "torques"],
    "effort": ["eff", "effort", "efforts"],
    "current": ["i", "cur", "current", "currents"],
}
_WORDS = {word: signal for signal, words in _CALLED.items() for word in words}
_RATES = {"dot", "ddot"}  # of positions; rates of torques are not signals
_OTHERS = {  # words of set points, contact estimates, and quantities not measured at a joint
    *("d", "des", "desired", "target", "targets", "cmd", "command", "commands", "commanded", "ref"),
    *("reference", "goal", "set", "setpoint", "action", "ipo", "ext", "external", "err", "error", "limit"),
    *("max", "min", "std", "window", "gain", "temperature", "model", "predicted", "gravity", "friction"),
    *("gripper", "finger", "fingers", "tcp", "ee", "eef", "tool", "cartesian", "sin", "cos", "next"),
}
_COMMANDED = {"des", "desired", "target", "cmd", "command", "commands", "commanded"}
_TIMES = {"t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "datetime"}
_SPANS = {"cycle", "execution", "computation", "delta", "start", "end"}  # times that are not time stamps
_KNOWN = {*_WORDS, *_OTHERS, *_TIMES, *_SPANS, *SECONDS}


@dataclass(frozen=True)
class Series:
    """Columns whose names differ only in a number or a joint's name."""

    before: str
    after: str
    named: bool
    columns: dict[int, str]  # by number, or by the joint's place in the chain

    @cached_property
    def words(self) -> list[str]:
        """Words that the column names have in common."""
        return [*_words(f"{self.before} {self.after}")]

    def of(self, places: Sequence[int], base: int) -> list[str]:
        """Existing columns of the joints at some places; numbers start at ``base``."""
        wanted = [place + (0 if self.named else base) for place in places]
        return [self.columns[k] for k in wanted if k in self.columns]

    def of_another_arm(self, arms: "Series") -> bool:
        """Whether names differ from the arm's by a single word that names no signal, as in left and right."""
        words = [*_words(next(iter(self.columns.values())))]
        others = [*_words(next(iter(arms.columns.values())))]
        swapped = {pair for pair in zip(words, others) if pair[0] != pair[1]}
        return len(words) == len(others) and len(swapped) == 1 and not {*next(iter(swapped))} & _KNOWN

    def pattern(self, base: int) -> str:
        """The pattern of the column names."""
        return f"{self.before}{{{'joint' if self.named else 'index' if base else 'index0'}}}{self.after}"

    def signal(self, effort: str, commanded: bool = False) -> str | None:
        """The signal of the columns; see ``signal_of``."""
        return signal_of(f"{self.before} {self.after}", effort, commanded)

    @property
    def foreign(self) -> set[str]:
        """Words that rule out that these are joint measurements."""
        return _OTHERS & {*self.words}


def signal_of(name: str, effort: str, commanded: bool = False) -> str | None:
    """The signal that the last known word of a name names: a "current position" is a position.

    ``effort`` is what an effort is, torque or current. ``commanded``: commanded torques count as measured.
    """
    words = {*_words(name)}
    signals = [_WORDS[word] for word in _words(name) if word in _WORDS]
    loads = {"torque", "effort", "current"} & {*signals}
    foreign = (words & _OTHERS) - (_COMMANDED if commanded and loads else set())
    if not signals or foreign or (loads and _RATES & words):
        return None
    return effort if signals[-1] == "effort" else signals[-1]


def is_commanded(column: str) -> bool:
    """Whether a column of torques is named as commanded ones."""
    return bool(_COMMANDED & {*_words(column)})


def series_of(available: Sequence[str], names: Sequence[str]) -> list[Series]:
    """All series of columns that differ only in a number, or in the name of a joint that is not a number."""
    found: dict[tuple[str, str, bool], dict[int, str]] = {}
    patterns: list[tuple[str, int | None]] = [(r"\d+", None)]
    patterns += [(_bounded(name), place) for place, name in enumerate(names) if not name.isdigit()]
    for column in available:
        for pattern, place in patterns:
            for match in re.finditer(pattern, column, re.IGNORECASE):
                key = column[: match.start()], column[match.end() :], place is not None
                found.setdefault(key, {}).setdefault(int(match[0]) if place is None else place, column)
    series: dict[tuple[str, str, bool], list[Series]] = {}
    for (before, after, named), columns in found.items():
        same = series.setdefault((before, without_unit(after), named), [])
        if same and not same[-1].columns.keys() & columns.keys():  # prismatic joints have another unit
            same[-1].columns.update(columns)
        else:
            same.append(Series(before, after, named, columns))
    return [each for same in series.values() for each in same]


def _bounded(name: str) -> str:
    """A regular expression for a name that is not part of a longer word or number."""
    before = r"\d" if name[:1].isdigit() else "[A-Za-z]"
    after = r"\d" if name[-1:].isdigit() else "[A-Za-z]"
    return rf"(?<!{before}){re.escape(name)}(?!{after})"


def _words(text: str) -> Iterator[str]:
    """Lower-case words of a name; unknown words are split at capitals."""
    for run in re.findall(r"[A-Za-z]+", text):
        if run.lower() in _KNOWN:
            yield run.lower()
        else:
            yield from (hump.lower() for hump in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", run))


def stamps_of(available: Sequence[str]) -> list[str]:
    """Columns of time stamps, those with the fewest words in their names."""
    ranked = []
    for column in available:
        words = [word for word in _words(column) if word not in SECONDS]
        if words and words[-1] in _TIMES and not _SPANS & {*words} and not re.search(r"\d", column):
            ranked.append((len(words), column))
    return [column for words, column in ranked if words == min(ranked)[0]]


def split_stamps(stamps: Sequence[str]) -> list[str]:
    """Columns of seconds and of nanoseconds, in this order, if stamps are split into two such; else none."""
    for pair in permutations(stamps) if len(stamps) == 2 else ():
        seconds, nanoseconds = ({SECONDS.get(word) for word in _words(column)} for column in pair)
        if 1.0 in seconds and 1e-9 in nanoseconds:
            return [*pair]
    return []


def own_names(available: Sequence[str], signal: str, count: int) -> list[str]:
    """Names of the ``count`` joints for which a file has a signal, in the order of its columns."""
    groups: dict[tuple[str, str], list[str]] = {}
    for column in available:
        marks = [k for m in re.finditer(r"[^A-Za-z0-9]", column) for k in m.span()]
        for start, end in combinations([0, *marks, len(column)], 2):
            if column[start:end].strip():
                groups.setdefault((column[:start], column[end:]), []).append(column[start:end])
    fitting = {
        key: names
        for key, names in groups.items()
        if len(names) == count and signal_of(" ".join(key), "torque") == signal
    }
    return fitting[max(fitting, key=lambda key: len(key[0]) + len(key[1]))] if fitting else []
