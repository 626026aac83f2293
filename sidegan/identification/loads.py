"""Loads that differ between recordings, or from some time of a recording on, such as an object picked up."""

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from sidegan.identification.fit import covariance_of, reweighted, torque_errors
from sidegan.identification.gather import Gathered
from sidegan.identification.identified import IdentifiedArm
from sidegan.identification.measurements import Measurements
from sidegan.identification.payload import LOAD, gathered_with
from sidegan.identification.sums import Sums
from sidegan.recording.check import CheckedRecording

_WINDOWS = 8  # equal parts of a recording, between which its load may change
_LEAST = 10  # samples of a part
_EXPLAINED = 0.5  # most of the error that may remain if a load is to explain it
_SURE = 5.0  # standard deviations from zero at which a mass is significant
_NOTABLE = 0.02  # smallest load that is reported, as a share of the arm's mass


def changed_load(found: IdentifiedArm) -> str:
    """Remark on a recording whose torques, or the later ones, another load explains; empty if none does."""
    each = [_parts(found, recording) for recording in found.recordings]
    ends = np.cumsum([len(parts) for parts in each]).tolist()
    later = [range(end - k, end) for end, parts in zip(ends, each) for k in range(1, len(parts))]
    whole = [range(end - len(parts), end) for end, parts in zip(ends, each) if parts]
    if len(whole) < 3:
        whole = whole[1:]  # the data cannot say which of two recordings it is
    parts = [part for parts in each for part in parts]
    load = _most_likely(found, parts, whole + later)
    if load is None:
        return ""
    first = parts[load.carried[0]]
    if load.carried in whole:
        return (
            f"{first.recording.name} was recorded with a different load than the others: {load.text}; "
            "identify from recordings with one load (+experiment=payload identifies the difference)"
        )
    return (
        f"from about {first.begin:.3g} s of {first.recording.name} on the load differs: {load.text}; "
        "was an object picked up or put down? cut the rows before or after"
    )


@dataclass(frozen=True, eq=False)
class _Part:
    """Samples of a part of a recording, with columns for a load."""

    recording: CheckedRecording
    begin: float  # [s]
    data: Gathered


@dataclass(frozen=True)
class _Load:
    """A load that an arm carries in some parts."""

    carried: range  # indices of these parts
    mass: float  # [kg]
    deviation: float  # of the mass [kg]
    remaining: float  # share of the squared residuals that remains with it
    link: str  # that carries it

    @property
    def text(self) -> str:
        """What explains the residuals."""
        return f"{self.mass:+.2g} ± {self.deviation:.1g} kg on {self.link} explains it"


def _parts(found: IdentifiedArm, recording: CheckedRecording) -> list[_Part]:
    """Equal parts of a recording; none if it is too short."""
    time, *signals = (np.concatenate(x) for x in zip(*recording.segments))
    if len(time) < _WINDOWS * _LEAST:
        return []
    cuts = np.array_split(np.arange(len(time)), _WINDOWS)
    samples = [Measurements(*(x[rows] for x in signals)) for rows in cuts]
    data = [gathered_with(found.model, [x], carried=True) for x in samples]
    return [_Part(recording, float(time[rows[0]]), x) for rows, x in zip(cuts, data)]


def _most_likely(found: IdentifiedArm, parts: list[_Part], candidates: list[range]) -> _Load | None:
    """The load that explains most, carried in one of these groups of parts; None if none explains enough."""
    loads = [_load(found, parts, carried) for carried in candidates]
    best = min(loads, key=lambda load: load.remaining, default=None)
    least = _NOTABLE * found.model.arm.inertial_parameters[:, 0].sum()
    if best is None or best.remaining > _EXPLAINED or abs(best.mass) < max(_SURE * best.deviation, least):
        return None
    return best


def _load(found: IdentifiedArm, parts: list[_Part], carried: range) -> _Load:
    """A load that is carried in some parts."""
    with_load = [part.data.sums for part in parts]
    without = [_without_load(sums, found.model.count) for sums in with_load]
    before = reduce(Sums.plus, without)
    sums = reduce(Sums.plus, (with_load[k] if k in carried else x for k, x in enumerate(without)))
    fit = reweighted(sums)
    left, now = before.squares(reweighted(before).parameters), sums.squares(fit.parameters)
    pieces = [piece for k in carried for piece in parts[k].data.pieces]
    errors = torque_errors(replace(parts[carried[0]].data, sums=sums, pieces=pieces), fit)
    deviation = float(np.sqrt(covariance_of(sums, fit, errors)[-LOAD, -LOAD]))
    remaining = float(np.exp(np.log(now / left).mean()))
    return _Load(carried, float(fit.parameters[-LOAD]), deviation, remaining, found.model.arm.link_names[-1])


def _without_load(sums: Sums, count: int) -> Sums:
    """Sums in which a load's columns, after the first ``count``, are zero."""
    kept = np.arange(sums.moment.shape[1]) < count
    return sums._replace(information=sums.information * (kept[:, None] & kept), moment=sums.moment * kept)
