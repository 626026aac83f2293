"""Which columns of a file hold which signal, by configured patterns or by their names."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

from sidegan.base.names import counted, listed
from sidegan.base.settings_text import suggest_fields, suggestion
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.column_names import (
    Series,
    is_commanded,
    own_names,
    series_of,
    signal_of,
    split_stamps,
    stamps_of,
)
from sidegan.recording.settings import AUTO, PLACEHOLDER, SIGNALS, RecordingSettings
from sidegan.recording.stamps import date_columns
from sidegan.recording.tables import SignalColumns, Table

_SHOWN = 3  # patterns that a message suggests
_JOINT = re.compile(r"\s*((joint|axis|motor)([ _]?(name|id|index|number))?|name|id)\s*", re.IGNORECASE)

# numbers of the arm's joints in a file, as places in the chain, and the number of the chain's first joint
Numbering = tuple[tuple[int, ...], int]


@dataclass(frozen=True)
class Joints:
    """Names and numbers of the arm's joints in a file."""

    # file's names of the arm's joints and of locked ones between them, from the base outwards
    chain: tuple[str, ...]
    places: tuple[int, ...]  # of the arm's joints among these
    own: tuple[str, ...]  # names of the arm's joints in its description
    slides: tuple[bool, ...]  # whether each of the arm's joints is prismatic

    @classmethod
    def of(
        cls,
        file: str,
        settings: RecordingSettings,
        joint_names: Sequence[str],
        chain: Mapping[str, bool],
    ) -> "Joints":
        """The arm's joints in a file; ``chain`` as in ``load_recording``, or empty."""
        own, whole = tuple(joint_names), tuple(chain or joint_names)
        named = tuple(settings.joints or whole)
        if len(named) not in (len(whole), len(own)):
            raise RecordingError(
                f"{file}: recording.joints has {counted(len(named), 'name')}, the arm has "
                f"{counted(len(own), 'joint')}: {', '.join(own)}"
            )
        places = map(whole.index, own) if len(named) == len(whole) else range(len(own))
        return cls(named, tuple(places), own, tuple(chain.get(name, False) for name in own))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arm's joints in the file."""
        return tuple(self.chain[place] for place in self.places)


def _filled(pattern: str, names: Sequence[str], places: Sequence[int]) -> list[str]:
    """Columns of a pattern for joints of these names and places (from 0); or the array of all joints."""
    if not PLACEHOLDER.search(pattern):
        return [pattern]
    values = [{"joint": n, "index": str(p + 1), "index0": str(p)} for n, p in zip(names, places)]
    return [PLACEHOLDER.sub(lambda match, x=x: x[match[1]], pattern) for x in values]  # type: ignore[misc]


class Finder:
    """Search for the columns of a file that hold time and signals, or only one signal."""

    def __init__(self, table: Table, settings: RecordingSettings, joints: Joints, only: str | None) -> None:
        self.file, self.table, self.settings, self.joints = table.file, table, settings, joints
        self.available = [*table.columns]
        self.only = only
        self.count = len(joints.places)
        self.effort = settings.effort
        self.loads = {name for name in ("torque", "current") if getattr(settings, name) is not None}
        measured = {signal_of(column, self.effort) for column in self.available}
        self.commanded = not self.loads & measured  # whether torques are commanded ones, if any
        self.series = series_of(self.available, joints.chain)
        self.numberings = self._numberings()
        self.numbering, *others = self._likeliest()
        self.ambiguous = bool(others)

    def found(self) -> tuple[SignalColumns, list[str]]:
        """Columns of time (two if split into seconds and nanoseconds) and each signal, and remarks."""
        time = self._time()
        where = {"time": time} if time else {}
        patterns: dict[str, str] = {}
        guessed = []
        for signal in [self.only] if self.only else SIGNALS:
            for pattern in self.settings.patterns(signal):
                columns, found = self._recognised(signal) if pattern == AUTO else self._configured(pattern)
                if columns:
                    where[signal], patterns[signal] = columns, found
                    guessed += [columns] if pattern == AUTO and "{joint}" not in found else []
                    break
            else:
                self._refuse_missing(signal)
        remarks = []
        for load in sorted(self.loads & {*where}):
            if AUTO in self.settings.patterns(load) and any(map(is_commanded, where[load])):
                remarks.append(
                    f"{load}s are commanded ones, {listed(where[load])}, since none are measured: they lack "
                    "what the drives' controllers add"
                )
        if not self.only and self.loads and not {"torque", "current"} & {*where}:
            like = "no column like 'tau{index}' or 'effort.{joint}'"
            raise RecordingError(
                f"{self.file} has no torque or current: {like}; it has {self._existing()}"
                f"{self._offers('torque') or self._another_file('position')}"
            )
        return where, [*remarks, *self._counted_from_zero(guessed), *self._unused_remarks(where, patterns)]

    def _time(self) -> list[str]:
        """Columns of time stamps; none if the file has none but its rate is known."""
        names = self.settings.time.split("|")
        stamps = [name for name in names if name in self.available][:1]
        if not stamps and AUTO in names:
            stamps = stamps_of(self.available) or date_columns(self.table)
        if not stamps and self.settings.rate is None:
            wanted = "like 't' or 'time'" if AUTO in names else " or ".join(map(repr, names))
            raise RecordingError(
                f"{self.file} has no column {wanted} of time stamps; it has {self._existing()}; name the "
                f"column, {suggestion('recording.time', 'NAME')}, or, without time stamps, state the "
                f"sampling rate [Hz]: {suggestion('recording.rate', 1000)}"
            )
        split = split_stamps(stamps)
        if len(stamps) > 1 and not split:
            self._refuse_several("time", stamps)
        return split or stamps

    def _configured(self, pattern: str) -> tuple[list[str], str]:
        """Columns of a configured pattern, none unless all exist, and the pattern."""
        for places in (self.joints.places, range(self.count)):
            columns = _filled(pattern, self.joints.names, places)
            if {*columns} <= {*self.available}:
                return columns, pattern
        return [], pattern

    def _recognised(self, signal: str) -> tuple[list[str], str]:
        """Columns named like the signal, or a single one that holds all joints, and their pattern."""
        ways = self._ways(self._of_this_arm(self._candidates(signal)), self.numbering)
        ways = ways or {(column,): column for column in self._arrays(signal)}
        if len(ways) > 1:
            self._refuse_several(signal, [*ways.values()])
        for columns, pattern in ways.items():
            left = 0 if "{joint}" in pattern else len(self._unused(columns, pattern))
            if left > thresholds.MOST_GRIPPER_COLUMNS:
                raise RecordingError(
                    f"{self.file} has {signal} of {counted(len(columns) + left, 'joint')}, the arm has "
                    f"{len(columns)}; if the first {len(columns)} are the arm's: {_typed(signal, pattern)}"
                )
            return [*columns], pattern
        return [], ""

    def _candidates(self, signal: str) -> list[Series]:
        """Series named like a signal; if the file is for that signal only, else those named like none."""
        called = [s for s in self.series if s.signal(self.effort, self.commanded) == signal]
        return called or [s for s in self.series if self.only and s.signal("") is None and not s.foreign]

    def _of_this_arm(self, series: Sequence[Series]) -> list[Series]:
        """Series, without another arm's numbered ones if this arm's joints occur by name."""
        whole = [s for s in series if s.named and len(s.of(self.joints.places, 0)) == self.count]
        return [s for s in series if s.named or not any(s.of_another_arm(arms) for arms in whole)]

    def _arrays(self, signal: str | None) -> list[str]:
        """Columns of lists with an element per joint that are named like a signal, or like none."""
        called = [c for c in self.available if signal_of(c, self.effort, self.commanded) == signal]
        return [c for c in called if self.table.width(c) == self.count]

    def _columns_in(self, series: Series, numbering: Numbering) -> tuple[tuple[str, ...], str]:
        """The arm's columns in a series with this numbering, and its pattern."""
        places, base = numbering
        return tuple(series.of(self.joints.places if series.named else places, base)), series.pattern(base)

    def _ways(self, series: Sequence[Series], numbering: Numbering) -> dict[tuple[str, ...], str]:
        """Patterns of series with all joints in this numbering, by their columns; names take precedence."""
        found = [self._columns_in(s, numbering) for s in sorted(series, key=lambda s: s.named)]
        return {columns: pattern for columns, pattern in found if len(columns) == self.count}

    def _numberings(self) -> list[Numbering]:
        """Possible numberings of the arm's joints; locked joints may or may not be counted.

        A file with columns of joint names states its numbering.
        """
        names = self.joints.names
        for series in self.series:
            if not series.named and series.words[-1:] in (["name"], ["names"]):
                numbers = {self.table.first(column): number for number, column in series.columns.items()}
                if {*names} <= {*numbers}:
                    return [(tuple(numbers[name] for name in names), 0)]
        distinct = dict.fromkeys([self.joints.places, tuple(range(self.count))])
        return [(places, base) for places in distinct for base in (0, 1)]

    def _likeliest(self) -> list[Numbering]:
        """Numberings with which most signals are complete, the likeliest first."""
        series = [s for s in self.series if not s.named]
        signals = [s for s in series if s.signal(self.effort)]

        def whole(kind: Sequence[Series], numbering: Numbering) -> int:
            return sum(len(s.of(*numbering)) == self.count for s in kind)

        scores = {x: (whole(signals, x), whole(series, x)) for x in self.numberings}
        if (most := max(scores.values())) == (0, 0):
            return [(self.joints.places, 0 if any(0 in s.columns for s in signals) else 1)]
        return [score for score in scores if scores[score] == most]

    def _unused(self, columns: Sequence[str], pattern: str) -> list[str]:
        """Numbered columns of a series that belong neither to the arm's joints nor to locked ones."""
        chain = self.joints.chain
        known = {*columns, *_filled(pattern, chain, range(len(chain)))}
        numbered = [{*s.columns.values()} for s in self.series if not s.named]
        left = {column for series in numbered if {*columns} <= series for column in series - known}
        return [column for column in self.available if column in left]

    def _counted_from_zero(self, guessed: Sequence[Sequence[str]]) -> list[str]:
        """A remark if joints are counted from 0 but named from 1, so that the columns read may surprise."""
        named = [(c, place) for s in self.series if s.named for place, c in s.columns.items()]
        taken = [dict(zip(columns, self.joints.places)) for columns in guessed]
        first = [next(iter(t)) for t in taken if any(t.get(c, place) != place for c, place in named)]
        if not first:
            return []
        return [f"joints are counted from 0: {self.joints.own[0]} is read from {listed(first)}, etc."]

    def _unused_remarks(self, where: SignalColumns, patterns: Mapping[str, str]) -> list[str]:
        """A remark on columns of more joints than the arm has."""
        lefts = {signal: self._unused(where[signal], pattern) for signal, pattern in patterns.items()}
        left = [*dict.fromkeys(column for columns in lefts.values() for column in columns)]
        if not left:
            return []
        has = f"the arm has {counted(self.count, 'joint')}"
        unused = f"not used: {listed(left)}; "
        zero = {s: p for s, p in patterns.items() if lefts[s] and "{index0}" in p}
        if not self.ambiguous or AUTO not in self.settings.patterns("position") or not zero:
            return [unused + has]
        other = suggest_fields("recording", {s: p.replace("{index0}", "{index}") for s, p in zero.items()})
        return [f"{unused}joints are counted from 0, and {has}; if the first joint is number 1: {other}"]

    def _refuse_missing(self, signal: str) -> None:
        """Raise if a signal is required, or present for at least half of the joints but not for all."""
        patterns = self.settings.patterns(signal)
        series = self._candidates(signal) if AUTO in patterns else []
        ways = [self._columns_in(s, self.numbering) for s in series]
        nearest, pattern = max(ways, key=lambda way: len(way[0]), default=((), ""))
        optional = (not patterns or AUTO in patterns) and not self.only and signal != "position"
        if optional and len(nearest) * 2 < self.count:
            return
        if not nearest and (by := next(filter(_JOINT.fullmatch, self.available), None)):
            raise RecordingError(
                f"{self.file} seems to have a row for each joint, by {by!r}, expected one a time stamp, "
                f"with all joints: table.pivot(columns={by!r}, …) of pandas makes that"
            )
        like = [pattern for pattern in patterns if pattern != AUTO] if not optional else []
        wanted = _filled(pattern or [*like, f"{signal}_{{index}}"][0], self.joints.names, self.numbering[0])
        own = self.joints.own
        missing = [column for column in wanted if column not in self.available]
        joints = [name for name, column in zip(own, wanted) if column in missing] if wanted[1:] else own
        raise RecordingError(
            f"{self.file} has no {signal} for {len(joints)} of the arm's {counted(len(own), 'joint')}: "
            f"no column {listed([repr(c) for c in missing])}; it has {self._existing()}"
            f"{self._remedy(signal, joints)}"
        )

    def _remedy(self, signal: str, joints: Sequence[str]) -> str:
        """The end of a message: what to type when joints lack a signal."""
        partial = len(joints) < len(self.joints.own)
        if signal == "position" or not partial:
            offers = self._offers(signal)
            return offers if offers or partial or self.only else self._another_file("effort")
        if signal in ("torque", "current"):
            without = suggestion("recording.without", [*self.settings.without, *joints])
            return f"; joints that do not move can be left out: {without}"
        return f"; to derive it instead: {suggestion(f'recording.{signal}', None)}"

    def _another_file(self, has: str) -> str:
        """The end of a message: how to give this file for the signal it has, and others for the rest."""
        files = {"position": "FILE", "effort": "FILE"} | {has: self.file}
        return f"; is it in another file? {suggestion('recordings', [files])}"

    def _offers(self, signal: str) -> str:
        """The end of a message: settings that would read the signal from other columns of the file."""
        unknown = [s for s in self.series if self.only or s.signal(self.effort) is None]
        ways = [self._ways(unknown, numbering) for numbering in self.numberings]
        patterns = [*dict.fromkeys(p for way in ways for p in way.values())]
        patterns += self._arrays(None)
        if patterns:
            return f"; would one of these fit? {', '.join(_typed(signal, p) for p in patterns[:_SHOWN])}"
        if names := own_names(self.available, signal, self.count):
            return f"; are its joints, in the arm's order, {suggestion('recording.joints', names)}?"
        return ""

    def _refuse_several(self, signal: str, ways: Sequence[str]) -> NoReturn:
        """Raise because a signal occurs in several, equally plausible ways."""
        listed_ways = " and as ".join(map(repr, ways))
        raise RecordingError(
            f"{self.file} has {signal} as {listed_ways}; choose one: {_typed(signal, ways[0])}"
        )

    def _existing(self) -> str:
        """Names of the file's columns, for a message."""
        return listed([repr(column) for column in self.available]) or "none"


def _typed(signal: str, pattern: str) -> str:
    """The pattern of a signal as a setting."""
    return suggestion(f"recording.{signal}", pattern)
