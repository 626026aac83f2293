"""Which columns of a file hold which signal: by the patterns that are set, or by what they are called."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

from sidegan.base.names import counted, listed
from sidegan.errors import RecordingError
from sidegan.recording.column_names import Series, is_split, own_names, series_of, stamps_of
from sidegan.recording.settings import AUTO, PLACEHOLDER, SIGNALS, RecordingSettings
from sidegan.recording.stamps import dated
from sidegan.recording.tables import Table, Where

_MOST_LEFT = 2  # columns after the arm's last joint that are a gripper's; more are another arm's
_SHOWN = 3  # patterns that a message offers

# places in the chain by which a file numbers the arm's joints, and the number of the chain's first joint
Numbering = tuple[tuple[int, ...], int]


@dataclass(frozen=True)
class Joints:
    """Names and numbers of the arm's joints in a file."""

    # names in the file of the arm's joints and of locked ones between them, from the base outwards
    chain: tuple[str, ...]
    places: tuple[int, ...]  # which of these are the arm's
    own: tuple[str, ...]  # names of the arm's joints in its description
    slides: tuple[bool, ...]  # which of the arm's do not turn

    @classmethod
    def of(
        cls,
        file: str,
        settings: RecordingSettings,
        joint_names: Sequence[str],
        chain: Sequence[str],
        sliding: Collection[str] = (),
    ) -> "Joints":
        """The arm's joints in a file, of a chain in which others may be locked; without names none are."""
        own = tuple(joint_names)
        every = tuple(chain or joint_names)
        named = tuple(settings.joints or every)
        slides = tuple(name in sliding for name in own)
        if len(named) == len(every):
            return cls(named, tuple(every.index(name) for name in own), own, slides)
        if len(named) == len(own):
            return cls(named, tuple(range(len(own))), own, slides)
        raise RecordingError(
            f"{file}: recording.joints has {counted(len(named), 'name')}, the arm has "
            f"{counted(len(own), 'joint')}: {', '.join(own)}"
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arm's joints in the file."""
        return tuple(self.chain[place] for place in self.places)


def _filled(pattern: str, names: Sequence[str], places: Sequence[int]) -> list[str]:
    """Columns of a pattern for joints of these names and places, counted from 0; or the one array of all."""
    if not PLACEHOLDER.search(pattern):
        return [pattern]
    each = [{"joint": n, "index": str(p + 1), "index0": str(p)} for n, p in zip(names, places)]
    return [PLACEHOLDER.sub(lambda match, one=one: one[match[1]], pattern) for one in each]  # type: ignore[misc]


class Finder:
    """Search for the columns of a file that hold time and signals, or the only one of interest."""

    def __init__(
        self, file: str, table: Table, settings: RecordingSettings, joints: Joints, only: str | None
    ) -> None:
        self.file, self.table, self.settings, self.joints = file, table, settings, joints
        self.available, self.only, self.effort = [*table.columns], only, settings.effort
        self.series = series_of(self.available, joints.chain)
        self.numberings = self._numberings()
        self.numbering, *others = self._likeliest()
        self.ambiguous = bool(others)

    def found(self) -> tuple[Where, list[str]]:
        """Columns of time, or two of seconds and nanoseconds, and of each signal, and remarks on them."""
        time = self._time()
        where = {"time": time} if time else {}
        patterns: dict[str, str] = {}
        guessed = []
        for signal in [self.only] if self.only else SIGNALS:
            for pattern in filter(None, (getattr(self.settings, signal) or "").split("|")):
                columns, found = self._called(signal) if pattern == AUTO else self._set(pattern)
                if columns:
                    where[signal], patterns[signal] = columns, found
                    guessed += [columns] if pattern == AUTO and "{joint}" not in found else []
                    break
            else:
                self._refuse_missing(signal)
        loads = [name for name in ("torque", "current") if getattr(self.settings, name) is not None]
        if not self.only and loads and not {"torque", "current"} & {*where}:
            like = "no column like 'tau{index}' or 'effort.{joint}'"
            raise RecordingError(
                f"{self.file} has no torque or current: {like}; it has {self._has()}"
                f"{self._offers('torque') or self._another_file('position')}"
            )
        return where, [*self._shifted(guessed), *self._left_over(where, patterns)]

    def _time(self) -> list[str]:
        """Columns of time stamps; none of a file without, whose rate is known."""
        names = self.settings.time.split("|")
        stamps = [name for name in names if name in self.available][:1]
        if not stamps and AUTO in names:
            stamps = stamps_of(self.available) or dated(self.table)
        if not stamps and self.settings.rate is None:
            wanted = "like 't' or 'time'" if AUTO in names else " or ".join(map(repr, names))
            raise RecordingError(
                f"{self.file} has no column {wanted} of time stamps; it has {self._has()}; name the column, "
                "recording.time=NAME, or, without time stamps, state the sampling rate [Hz]: "
                "recording.rate=1000"
            )
        if len(stamps) > 1 and not is_split(stamps):
            self._refuse_several("time", stamps)
        return stamps

    def _set(self, pattern: str) -> tuple[list[str], str]:
        """Columns of a pattern that is set, where all are there, and the pattern."""
        for places in (self.joints.places, range(len(self.joints.places))):
            columns = _filled(pattern, self.joints.names, places)
            if {*columns} <= {*self.available}:
                return columns, pattern
        return [], pattern

    def _called(self, signal: str) -> tuple[list[str], str]:
        """Columns that are the signal's by their names, and their pattern; none where there are none.

        The column is one where it holds all joints.
        """
        ways = self._ways(self._own(self._candidates(signal)), self.numbering)
        ways = ways or {(one,): one for one in self._arrays(signal)}
        if len(ways) > 1:
            self._refuse_several(signal, [*ways.values()])
        for columns, pattern in ways.items():
            left = 0 if "{joint}" in pattern else len(self._left(columns, pattern))
            if left > _MOST_LEFT:
                raise RecordingError(
                    f"{self.file} has {signal} of {counted(len(columns) + left, 'joint')}, the arm has "
                    f"{len(columns)}; if the first {len(columns)} are the arm's: {_typed(signal, pattern)}"
                )
            return [*columns], pattern
        return [], ""

    def _candidates(self, signal: str) -> list[Series]:
        """Series that are called as a signal; in a file of that alone those that are called as none."""
        called = [s for s in self.series if s.signal(self.effort) == signal]
        return called or [s for s in self.series if self.only and s.signal("") is None and not s.foreign]

    def _own(self, series: Sequence[Series]) -> list[Series]:
        """Series without numbered ones of another arm, where this one's are there by their names."""
        whole = [s for s in series if s.named and len(s.of(self.joints.places, 0)) == len(self.joints.places)]
        return [s for s in series if s.named or not any(s.of_another_arm(one) for one in whole)]

    def _arrays(self, signal: str | None) -> list[str]:
        """Columns of lists with an element for each joint that are called as a signal, or as none."""
        called = [c for c in self.available if Series(c, "", True, {}).signal(self.effort) == signal]
        return [c for c in called if self.table.width(c) == len(self.joints.places)]

    def _of(self, one: Series, numbering: Numbering) -> tuple[tuple[str, ...], str]:
        """Columns of a series that are the arm's joints', numbered like this, and its pattern."""
        places, base = numbering
        return tuple(one.of(self.joints.places if one.named else places, base)), one.pattern(base)

    def _ways(self, series: Sequence[Series], numbering: Numbering) -> dict[tuple[str, ...], str]:
        """Patterns of series that have all joints, numbered like this, by their columns; names win."""
        each = [self._of(one, numbering) for one in sorted(series, key=lambda one: one.named)]
        return {columns: pattern for columns, pattern in each if len(columns) == len(self.joints.places)}

    def _numberings(self) -> list[Numbering]:
        """Ways to number the arm's joints: their places, and the number of the first joint of the chain.

        Locked joints have numbers, too, or else none. A file that names its joints in columns has
        numbered them.
        """
        names, count = self.joints.names, len(self.joints.places)
        for one in self.series:
            if not one.named and one.words[-1:] in (["name"], ["names"]):
                numbers = {self.table.first(column): number for number, column in one.columns.items()}
                if {*names} <= {*numbers}:
                    return [(tuple(numbers[name] for name in names), 0)]
        every = dict.fromkeys([self.joints.places, tuple(range(count))])
        return [(places, base) for places in every for base in (0, 1)]

    def _likeliest(self) -> list[Numbering]:
        """Numberings with which most signals are whole, the likeliest first."""
        count = len(self.joints.places)
        series = [s for s in self.series if not s.named]
        signals = [s for s in series if s.signal(self.effort)]
        scores = {
            numbering: tuple(sum(len(s.of(*numbering)) == count for s in some) for some in (signals, series))
            for numbering in self.numberings
        }
        if (most := max(scores.values())) == (0, 0):
            return [(self.joints.places, 0 if any(0 in s.columns for s in signals) else 1)]
        return [score for score in scores if scores[score] == most]

    def _left(self, columns: Sequence[str], pattern: str) -> list[str]:
        """Numbered columns that go on after those of the arm's joints, and of locked ones by the pattern."""
        chain = self.joints.chain
        known = {*columns, *_filled(pattern, chain, range(len(chain)))}
        numbered = [{*s.columns.values()} for s in self.series if not s.named]
        left = {column for some in numbered if {*columns} <= some for column in some - known}
        return [column for column in self.available if column in left]

    def _shifted(self, guessed: Sequence[Sequence[str]]) -> list[str]:
        """A sentence about numbered columns that are called as other joints than they are taken for."""
        named = [(c, place) for s in self.series if s.named for place, c in s.columns.items()]
        taken = [dict(zip(columns, self.joints.places)) for columns in guessed]
        first = [next(iter(one)) for one in taken if any(one.get(c, place) != place for c, place in named)]
        if not first:
            return []
        return [f"joints are counted from 0: {self.joints.own[0]} is read from {listed(first)}, etc."]

    def _left_over(self, where: Where, patterns: Mapping[str, str]) -> list[str]:
        """A sentence about columns of more joints than the arm has."""
        lefts = {signal: self._left(where[signal], pattern) for signal, pattern in patterns.items()}
        left = [*dict.fromkeys(column for some in lefts.values() for column in some)]
        if not left:
            return []
        has = f"the arm has {counted(len(self.joints.places), 'joint')}"
        said = f"not used: {listed(left)}; "
        zero = {s: p for s, p in patterns.items() if lefts[s] and "{index0}" in p}
        if not self.ambiguous or AUTO not in self.settings.position or not zero:
            return [said + has]
        other = " ".join(_typed(s, p.replace("{index0}", "{index}")) for s, p in zero.items())
        return [f"{said}joints are counted from 0, and {has}; if the first joint is number 1: {other}"]

    def _refuse_missing(self, signal: str) -> None:
        """Raise when a signal has to be there, or is for half of the joints or more, but not for all."""
        patterns = (getattr(self.settings, signal) or "").split("|")
        series = self._candidates(signal) if AUTO in patterns else []
        ways = [self._of(one, self.numbering) for one in series]
        nearest, pattern = max(ways, key=lambda way: len(way[0]), default=((), ""))
        optional = AUTO in patterns and not self.only and signal != "position"
        if patterns == [""] or (optional and len(nearest) * 2 < len(self.joints.places)):
            return
        like = [pattern for pattern in patterns if pattern != AUTO] if not optional else []
        wanted = _filled(pattern or [*like, f"{signal}_{{index}}"][0], self.joints.names, self.numbering[0])
        own, missing = self.joints.own, [column for column in wanted if column not in self.available]
        joints = [name for name, column in zip(own, wanted) if column in missing] if wanted[1:] else own
        raise RecordingError(
            f"{self.file} has no {signal} for {len(joints)} of the arm's {counted(len(own), 'joint')}: "
            f"no column {listed([repr(c) for c in missing])}; it has {self._has()}"
            f"{self._remedy(signal, joints)}"
        )

    def _remedy(self, signal: str, joints: Sequence[str]) -> str:
        """Words to type when a signal of some joints is missing."""
        partial = len(joints) < len(self.joints.own)
        if signal == "position" or not partial:
            return self._offers(signal) or self._another_file("effort") * (not partial and not self.only)
        if signal in ("torque", "current"):
            return f"; joints that do not move can be left out: 'recording.without=[{','.join(joints)}]'"
        return f"; to derive it instead: recording.{signal}=null"

    def _another_file(self, has: str) -> str:
        """Words to type when another file has what this one lacks, and this one has a signal."""
        files = {"position": "FILE", "effort": "FILE"} | {has: self.file}
        each = ", ".join(f"{signal}: {file}" for signal, file in files.items())
        return f"; is it in another file? 'recordings=[{{{each}}}]'"

    def _offers(self, signal: str) -> str:
        """Settings with which other columns of the file would be the signal."""
        unknown = [s for s in self.series if self.only or s.signal(self.effort) is None]
        ways = [self._ways(unknown, numbering) for numbering in self.numberings]
        patterns = [*dict.fromkeys(p for one in ways for p in one.values())]
        patterns += self._arrays(None)
        if patterns:
            return f"; would one of these fit? {', '.join(_typed(signal, p) for p in patterns[:_SHOWN])}"
        names = ",".join(own_names(self.available, signal, len(self.joints.places)))
        return f"; are its joints, in the arm's order, 'recording.joints=[{names}]'?" if names else ""

    def _refuse_several(self, signal: str, ways: Sequence[str]) -> NoReturn:
        """Raise: a signal is there in more than one way, between which nothing decides."""
        listed_ways = " and as ".join(map(repr, ways))
        raise RecordingError(
            f"{self.file} has {signal} as {listed_ways}; choose one: {_typed(signal, ways[0])}"
        )

    def _has(self) -> str:
        return listed([repr(column) for column in self.available]) or "none"


def _typed(signal: str, pattern: str) -> str:
    """A setting as a word on the command line."""
    return f"'recording.{signal}=\"{pattern}\"'"
