"""Which columns of a file hold which signal: by the patterns that are set, or by what they are called."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sidegan.base.names import counted, listed
from sidegan.errors import RecordingError
from sidegan.recording.called import Series, is_split, own_names, series_of, stamps_of
from sidegan.recording.joints import Joints, filled
from sidegan.recording.settings import AUTO, SIGNALS, Columns
from sidegan.recording.tables import Table

_MOST_LEFT = 2  # columns after the arm's last joint that are a gripper's; more are another arm's
_SHOWN = 3  # patterns that a message offers


@dataclass(frozen=True)
class Found:
    """Columns of time and signals that a file has."""

    # by name: a column per joint, or a single one that is an array (S, J); two of time are seconds and
    # nanoseconds
    where: dict[str, list[str]]
    remarks: list[str]  # what a person should know about that


def columns_of(file: str, table: Table, columns: Columns, joints: Joints, only: str | None = None) -> Found:
    """Columns of a file that hold time and signals; of a file of one signal, ``only`` is that signal.

    Raises:
        RecordingError: when time or positions are missing, a signal is incomplete or there in two ways.
    """
    return _Finder(file, table, columns, joints, only).found()


class _Finder:
    def __init__(self, file: str, table: Table, columns: Columns, joints: Joints, only: str | None) -> None:
        self.only = only
        self.file, self.available, self.columns, self.joints = file, table.columns, columns, joints
        self.series = [*series_of(self.available, joints.chain)]
        chains = self.joints.places, tuple(range(len(self.joints.places)))
        orders = [order for s in self.series if s.names and (order := self._order(s, table.first))]
        self.every = [(places, base) for places in chains for base in (0, 1)]
        self.every = [(order, 0) for order in orders[:1]] or self.every
        (self.places, self.base), *others = self._numberings()
        self.ambiguous = bool(others)
        self.shifted: list[str] = []  # columns of the first joint, where others are called as other joints
        self.left: dict[str, str] = {}  # columns of more joints than the arm's, and the pattern they continue

    def found(self) -> Found:
        time = self._time()
        where = {"time": time} if time else {}
        for signal in [self.only] if self.only else SIGNALS:
            if columns := self._signal(signal):
                where[signal] = columns
        loads = [name for name in ("torque", "current") if getattr(self.columns, name) is not None]
        if not self.only and loads and not {"torque", "current"} & {*where}:
            like = "no column like 'tau{index}' or 'effort.{joint}'"
            raise RecordingError(
                f"{self.file} has neither torque nor current: {like}; it has {self._has()}"
                f"{self._offers('torque') or self._another_file('position')}"
            )
        return Found(where, [*self._shifted(), *self._left_over(where)])

    def _time(self) -> list[str]:
        """Columns of time stamps; none of a file without, whose rate is known.

        Raises:
            RecordingError: when there is none, or several.
        """
        names = self.columns.time.split("|")
        stamps = [name for name in names if name in self.available][:1]
        if not stamps and AUTO in names:
            stamps = stamps_of(self.available)
        if not stamps and self.columns.rate is None:
            wanted = "like 't' or 'time'" if AUTO in names else " or ".join(map(repr, names))
            raise RecordingError(
                f"{self.file} has no column {wanted} of time stamps; it has {self._has()}; say which it is, "
                "recording.time=NAME, or without a clock how many rows there are in a second: "
                "recording.rate=1000"
            )
        if len(stamps) > 1 and not is_split(stamps):
            self._refuse_several("time", stamps)
        return stamps

    def _signal(self, signal: str) -> list[str]:
        """Columns of a signal; none where the file has none, and that is no matter."""
        patterns = (getattr(self.columns, signal) or "").split("|")
        if patterns == [""]:
            return []
        for pattern in patterns:
            columns = self._named(signal) if pattern == AUTO else self._set(pattern)
            if columns:
                return columns
        if AUTO in patterns and not self.only and signal != "position":
            self._refuse_partial(signal)
            return []
        raise self._missing(signal, patterns)

    def _set(self, pattern: str) -> list[str]:
        """Columns of a pattern that is set, where all are there."""
        names, joints = self.joints.names, len(self.joints.names)
        for places in dict.fromkeys([self.joints.places, tuple(range(joints))]):
            columns = filled(pattern, names, places)
            if {*columns} <= {*self.available}:
                self._note_left(columns, pattern)
                return columns
        return []

    def _candidates(self, signal: str) -> list[Series]:
        """Series that are called as a signal; in a file of that alone those that are called as none."""
        called = [s for s in self.series if s.signal(self.columns.effort) == signal]
        return called or [s for s in self.series if self.only and s.signal("") is None and not s.foreign]

    def _named(self, signal: str) -> list[str]:
        """Columns that are the signal's by their names."""
        ways = self._ways(self._candidates(signal), self.places, self.base)
        if len(ways) > 1:
            self._refuse_several(signal, [*ways.values()])
        for columns, pattern in ways.items():
            self._note_left(columns, pattern)
            if "{joint}" not in pattern:
                self._note_shifted(columns)
            left = [c for c, p in self.left.items() if p == pattern and "{joint}" not in p]
            if len(left) > _MOST_LEFT:
                raise RecordingError(
                    f"{self.file} has {signal} of {counted(len(columns) + len(left), 'joint')}, the arm has "
                    f"{len(columns)}; if its first ones are the arm's, say so: {_typed(signal, pattern)}"
                )
            return [*columns]
        return []

    def _ways(self, series: Sequence[Series], places: Sequence[int], base: int) -> dict[tuple[str, ...], str]:
        """Patterns of series that have all joints, numbered like this, by their columns; names go first."""
        ways: dict[tuple[str, ...], str] = {}
        for one in sorted(series, key=lambda one: not one.named):
            columns = one.of(self.joints.places if one.named else places, base)
            if len(columns) == len(places):
                ways.setdefault(tuple(columns), one.pattern(base))
        return ways

    def _order(self, series: Series, first: Mapping[str, str]) -> tuple[int, ...]:
        """Numbers of the arm's joints in a file that names them in columns; none where one is missing."""
        numbers = {first.get(column): number for number, column in series.columns.items()}
        found = tuple(numbers[name] for name in self.joints.names if name in numbers)
        return found if len(found) == len(self.joints.names) else ()

    def _numberings(self) -> list[tuple[tuple[int, ...], int]]:
        """How the file may number the arm's joints: their places, and the number of the first joint.

        Those with which most signals are whole; the first is the likeliest. Locked joints have numbers, too,
        or else none.
        """
        count = len(self.joints.places)
        series = [s for s in self.series if not s.named]
        signals = [s for s in series if s.signal(self.columns.effort)]
        scores = {
            one: tuple(sum(len(s.of(*one)) == count for s in some) for some in (signals, series))
            for one in self.every
        }
        if (most := max(scores.values())) == (0, 0):
            return [(self.joints.places, 0 if any(0 in s.columns for s in signals) else 1)]
        return [one for one in scores if scores[one] == most]

    def _note_left(self, columns: Sequence[str], pattern: str) -> None:
        """Take down columns that go on after those of the arm's joints."""
        for one in self.series:
            if not one.named and {*columns} <= {*one.columns.values()}:
                mine = {*filled(pattern, self.joints.chain, range(len(self.joints.chain))), *columns}
                self.left |= {column: pattern for column in one.columns.values() if column not in mine}

    def _note_shifted(self, columns: Sequence[str]) -> None:
        """Take down columns that are called as other joints than the ones they are taken for."""
        taken = dict(zip(columns, self.joints.places))
        named = [(c, place) for s in self.series if s.named for place, c in s.columns.items()]
        if any(taken.get(c, place) != place for c, place in named):
            self.shifted.append(columns[0])

    def _shifted(self) -> list[str]:
        """A sentence about numbers that are not those of the joints' names."""
        if not self.shifted:
            return []
        are = "is" if len(self.shifted) == 1 else "are"
        own = self.joints.own[0]
        return [f"joints are counted from 0: {listed(self.shifted)} {are} taken for {own}, and so on"]

    def _left_over(self, where: dict[str, list[str]]) -> list[str]:
        """A sentence about columns of more joints than the arm has."""
        if not self.left:
            return []
        are = "is" if len(self.left) == 1 else "are"
        has = f"the arm has {counted(len(self.joints.places), 'joint')}"
        said = f"{listed([*self.left])} {are} left over: "
        zero = [p for p in dict.fromkeys(self.left.values()) if "{index0}" in p]
        meant = {s: p for s in where for p in zero if where[s] == filled(p, self.joints.names, self.places)}
        if not self.ambiguous or AUTO not in self.columns.position or not meant:
            return [said + has]
        other = " ".join(_typed(s, p.replace("{index0}", "{index}")) for s, p in meant.items())
        return [f"{said}joints are counted from 0, and {has}; if its first one is number 1, say so: {other}"]

    def _refuse_partial(self, signal: str) -> None:
        """Raise when a signal is there for half of the joints or more."""
        if len(self._nearest(signal)[0]) * 2 >= len(self.joints.places):
            raise self._missing(signal, [AUTO])

    def _nearest(self, signal: str) -> tuple[list[str], str]:
        """Columns of the series that lacks the fewest of the signal's, and its pattern."""
        series = self._candidates(signal)
        there = [(s.of(self.joints.places if s.named else self.places, self.base), s) for s in series]
        columns, one = max(there, key=lambda pair: len(pair[0]), default=([], None))
        return columns, "" if one is None else one.pattern(self.base)

    def _missing(self, signal: str, patterns: Sequence[str]) -> RecordingError:
        """What to say about columns that are not there."""
        like = [pattern for pattern in patterns if pattern != AUTO] or [f"{signal}_{{index}}"]
        nearest = self._nearest(signal)[1] if AUTO in patterns else ""
        wanted, own = filled(nearest or like[0], self.joints.names, self.places), self.joints.own
        lacking = [column for column in wanted if column not in self.available]
        joints = [name for name, column in zip(own, wanted) if column in lacking] if wanted[1:] else own
        return RecordingError(
            f"{self.file} has no {signal} of {len(joints)} of the arm's {counted(len(own), 'joint')}: "
            f"no column {listed([repr(c) for c in lacking])}; it has {self._has()}"
            f"{self._remedy(signal, joints)}"
        )

    def _remedy(self, signal: str, joints: Sequence[str]) -> str:
        """What to type when a signal of some joints is missing."""
        partial = len(joints) < len(self.joints.own)
        if signal == "position" or not partial:
            return self._offers(signal) or self._another_file("effort") * (not partial and not self.only)
        if signal in ("torque", "current"):
            return f"; joints that stand still can be left out: 'recording.without=[{','.join(joints)}]'"
        return f"; recording.{signal}=null derives it"

    def _another_file(self, has: str) -> str:
        """What to type when another file has what this one lacks, and this one has a signal."""
        files = {"position": "FILE", "effort": "FILE"} | {has: self.file}
        each = ", ".join(f"{signal}: {file}" for signal, file in files.items())
        return f"; is it in a file of its own? 'recordings=[{{{each}}}]'"

    def _offers(self, signal: str) -> str:
        """Settings with which other columns of the file would be the signal."""
        unknown = [s for s in self.series if self.only or s.signal(self.columns.effort) is None]
        arrays = [c for c in self.available if Series(c, "", True, {}).signal(self.columns.effort) == signal]
        ways = [self._ways(unknown, *numbers) for numbers in dict.fromkeys(self.every)]
        patterns = [
            *dict.fromkeys(p for one in ways for p in one.values()),
            *(arrays if len(arrays) == 1 else []),
        ]
        if patterns:
            return f"; would one of these fit? {', '.join(_typed(signal, p) for p in patterns[:_SHOWN])}"
        names = own_names(self.available, signal, len(self.joints.places))
        return (
            f"; are its joints, in the arm's order, 'recording.joints=[{','.join(names)}]'?" if names else ""
        )

    def _refuse_several(self, signal: str, ways: Sequence[str]) -> None:
        """Raise: a signal is there in more than one way, between which nothing decides."""
        listed_ways = " and as ".join(map(repr, ways))
        raise RecordingError(
            f"{self.file} has {signal} as {listed_ways}; say which is meant: {_typed(signal, ways[0])}"
        )

    def _has(self) -> str:
        return listed([repr(column) for column in self.available]) or "none"


def _typed(signal: str, pattern: str) -> str:
    """A setting as a word on the command line."""
    return f"'recording.{signal}=\"{pattern}\"'"
