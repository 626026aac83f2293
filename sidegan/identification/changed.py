"""What differs between recordings, or changes within one: the load, or friction."""

from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from sidegan.base.arrays import Array, geometric_mean
from sidegan.identification.fit import Fit, covariance_of, reweighted, torque_errors
from sidegan.identification.gather import Gathered, gather
from sidegan.identification.identified import IdentifiedArm
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.payload import LOAD
from sidegan.identification.sums import Sums, no_sums
from sidegan.recording.check import CheckedRecording

_WINDOWS = 8  # equal parts of a recording, between which its load may change
_LEAST = 10  # samples of a part
_EXPLAINED = 0.5  # most of the squared residuals that may remain if a change is to explain them
_FITS = 0.1  # most of the torques' squares that may remain then
_SURE = 5.0  # standard deviations from zero at which a load's mass is significant
_NOTABLE = 0.02  # smallest load that is reported, as a share of the arm's mass
_TINY = np.finfo(float).tiny


def change_in(found: IdentifiedArm) -> list[str]:
    """A remark on the change that explains most of an arm's residuals; empty if none does."""
    each = [_parts(found, recording) for recording in found.recordings]
    ends = np.cumsum([len(parts) for parts in each]).tolist()
    later = [range(end - k, end) for end, parts in zip(ends, each) for k in range(1, len(parts))]
    whole = [range(end - len(parts), end) for end, parts in zip(ends, each) if parts]
    if len(whole) < 3:
        whole = whole[1:]  # the data cannot say which of two recordings it is
    parts = [part for parts in each for part in parts]
    onwards = [range(k, len(parts)) for k in range(1, len(parts))]  # an arm that has warmed up stays warm
    where = {"load": whole + later}
    if {"viscous", "coulomb"} <= {*found.model.kinds}:
        where["friction"] = [*dict.fromkeys(whole + onwards)]
    samples = _Samples.of(_Extended(found.model), parts)
    changes = [_change(samples, changed, kind) for kind, ranges in where.items() for changed in ranges]
    believed = [change for change in changes if change.believed]
    best = min(believed, key=lambda change: change.remaining, default=None)
    return [] if best is None else [best.text]


class _Extended:
    """A model with further columns for changed parts: a load on the last link, and friction."""

    def __init__(self, model: TorqueModel) -> None:
        joints, first = model.joints, model.count
        self.model, self.joints = model, joints
        self._friction = Terms(offset=False, sign_width=model.terms.sign_width)
        self.further = {
            "load": slice(first, first + LOAD),
            "friction": slice(first + LOAD, first + LOAD + 2 * joints),
        }
        self.count = first + LOAD + 2 * joints

    def columns(self, kind: str | None = None) -> Array:
        """Which columns are the model's, or those of one kind of change, (P + 10 + 2 J,)."""
        kept = np.arange(self.count) < self.model.count
        if kind is not None:
            kept[self.further[kind]] = True
        return kept

    def regressor(self, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Regressor, (S, J, P + 10 + 2 J), of states (S, J)."""
        load = self.model.body.regressor(q, dq, ddq)[..., -LOAD:]
        friction = [x[..., None] * np.eye(self.joints) for x in self._friction.signals(dq, ddq, sign)]
        return np.concatenate([self.model.regressor(q, dq, ddq, sign), load, *friction], 2)


@dataclass(frozen=True, eq=False)
class _Part:
    """Samples of a part of a recording, with the further columns."""

    recording: CheckedRecording
    begin: float  # [s]
    data: Gathered[_Extended]


@dataclass(frozen=True, eq=False)
class _Samples:
    """All parts of an arm's recordings."""

    model: _Extended
    parts: list[_Part]
    upto: list[Sums]  # over the parts before each, and over all
    before: Array  # squared residuals without a change, (J,)

    @classmethod
    def of(cls, model: _Extended, parts: list[_Part]) -> "_Samples":
        """Those of some parts."""
        nothing = no_sums(model.joints, model.count)
        upto = [*accumulate((part.data.sums for part in parts), Sums.plus, initial=nothing)]
        unchanged = _only(upto[-1], model.columns())
        return cls(model, parts, upto, unchanged.squares(reweighted(unchanged).parameters))


@dataclass(frozen=True, eq=False)
class _Change:
    """A change in some parts of recordings, fitted together with the model."""

    samples: _Samples
    changed: range  # indices of these parts
    kind: str
    fit: Fit
    sums: Sums  # of all parts, with the change
    deviation: float  # of a load's mass [kg]

    @property
    def after(self) -> Array:
        """Squared residuals with the change, (J,)."""
        return np.maximum(self.sums.squares(self.fit.parameters), _TINY)

    @property
    def remaining(self) -> float:
        """Share of the squared residuals that remains, geometric mean over joints."""
        return geometric_mean(self.after / np.maximum(self.samples.before, _TINY))

    @property
    def mass(self) -> float:
        """Mass of the load [kg]."""
        return float(self.fit.parameters[self.samples.model.further["load"]][0])

    @property
    def believed(self) -> bool:
        """Whether the change explains the residuals, and is significant."""
        left = geometric_mean(self.after / np.maximum(self.sums.energy, _TINY))
        least = _NOTABLE * self.samples.model.model.arm.inertial_parameters[:, 0].sum()
        heavy = abs(self.mass) > max(_SURE * self.deviation, least)
        return self.remaining < _EXPLAINED and left < _FITS and (self.kind != "load" or heavy)

    @property
    def text(self) -> str:
        """Remark on the change."""
        parts, arm = self.samples.parts, self.samples.model.model.arm
        first = parts[self.changed[0]]
        name = first.recording.name
        within = first.begin > min(part.begin for part in parts if part.recording is first.recording)
        where = f"from about {first.begin:.3g} s of {name} on" if within else f"in {name}"
        explains = f"{self.mass:+.2g} ± {self.deviation:.1g} kg on {arm.link_names[-1]} explains it"
        names = arm.named(self.after < _EXPLAINED * self.samples.before)
        if self.kind == "friction":
            return (
                f"{where} the friction of {names} differs: is the arm warmer or colder there, or much slower "
                "or faster? record after warming up, and identify from recordings of one temperature and pace"
            )
        if within:
            return (
                f"{where} the load differs: {explains}; was an object picked up or put down? cut the rows "
                "before or after"
            )
        return (
            f"{name} was recorded with a different load than the others: {explains}; identify from "
            "recordings with one load (+experiment=payload identifies the difference)"
        )


def _parts(found: IdentifiedArm, recording: CheckedRecording) -> list[_Part]:
    """Equal parts of a recording; none if it is too short."""
    time, *signals = (np.concatenate(x) for x in zip(*recording.segments))
    if len(time) < _WINDOWS * _LEAST:
        return []
    cuts = np.array_split(np.arange(len(time)), _WINDOWS)
    samples = [Measurements(*(x[rows] for x in signals)) for rows in cuts]
    data = [gather(_Extended(found.model), x) for x in samples]
    return [_Part(recording, float(time[rows[0]]), x) for rows, x in zip(cuts, data)]


def _change(samples: _Samples, changed: range, kind: str) -> _Change:
    """A change of one kind in some parts, fitted together with the model."""
    model, upto = samples.model, samples.upto
    inside = upto[changed.stop].minus(upto[changed.start])
    rest = _only(upto[-1].minus(inside), model.columns())
    sums = rest.plus(_only(inside, model.columns(kind)))
    fit = reweighted(sums)
    deviation = 0.0
    if kind == "load":
        parts = [samples.parts[k].data for k in changed]
        pieces = [piece for part in parts for piece in part.pieces]
        errors = torque_errors(Gathered(parts[0].model, sums, pieces, parts[0].reach), fit)
        mass = model.further["load"].start
        deviation = float(np.sqrt(covariance_of(sums, fit, errors)[mass, mass]))
    return _Change(samples, changed, kind, fit, sums, deviation)


def _only(sums: Sums, kept: Array) -> Sums:
    """Sums in which columns that are not kept, (P,), are zero."""
    return sums._replace(information=sums.information * (kept[:, None] & kept), moment=sums.moment * kept)
