"""Which effects on single joints a model gets: those that predict data held out in turn clearly better."""

from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import pairwise, product
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.stats import gmean

from sidegan.base.arrays import TINY, Array
from sidegan.base.names import listed
from sidegan.errors import ConfigError
from sidegan.identification.effects import EFFECT_KINDS, PLACES, Effects
from sidegan.identification.fit import LEAST, gather, weighted_least_squares
from sidegan.identification.measurements import Measurements, subsample
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums, solve
from sidegan.identification.thresholds import WITH_EFFECT, WITH_EFFECT_IN_ONE

_STRETCHES = 4  # of a single recording, held out in turn
_SAMPLES = 10_000  # enough to tell effects apart
_FORMS = 2  # parameters that may share this gain: an effect with four of them has to bring it twice
_ROUNDS = 8  # in which loads are computed anew
_SETTLED = 1e-3  # change of loads at which they have converged, as a share of the torque

Key: TypeAlias = tuple[int, str]  # a joint, and a kind of ``EFFECT_KINDS``


class Effect(NamedTuple):
    """An effect that is a term of a model."""

    joint: int
    kind: str  # of ``EFFECT_KINDS``
    error: float  # the joint's squared error on data held out in turn, over that without the effect


def effects_of(
    model: TorqueModel,
    recordings: Sequence[Sequence[Measurements]],
    wanted: Mapping[str, Sequence[str]] | None = None,
) -> tuple[Effects | None, list[Effect]]:
    """Effects for a model without any: those for which recordings speak, or wanted kinds by joints' names.

    Also what each buys.

    Recordings, or stretches of one, are held out in turn. Kinds are tried in all joints at once and judged
    joint by joint: the best is kept where errors fall in every part, and by 5 % (in one recording by
    30 %) or more both in the mean over parts and in a fit of all.

    Friction that grows with the load needs the load, the torque of links and rotors, and these are fitted
    with it. Both are computed in turn: each change is the last one times the share of friction in the load,
    usually a tenth. The load of the eighth round stands in any case: errors are of the model that has it.

    Raises:
        ConfigError: when ``wanted`` has a joint that the arm does not have.
    """
    joints = model.arm.joint_names
    if unknown := sorted({*(wanted or {})} - {*joints}):
        raise ConfigError(f"model.effects names {listed(unknown)}, expected joints of {listed(joints)}")
    named = [(joints.index(name), kind) for name, kinds in (wanted or {}).items() for kind in kinds]
    chosen = [*dict.fromkeys(named)]
    parts = _parts(recordings)
    better = WITH_EFFECT if len(recordings) > 1 else WITH_EFFECT_IN_ONE
    plain = reduce(Sums.plus, [gather(model, part).sums for part in parts])
    fit = weighted_least_squares(plain)
    load = fit.parameters[: model.moved]
    for _ in range(_ROUNDS):
        usual = np.sqrt(np.maximum(_squares(plain, load), TINY) / plain.weight)
        every = Effects([*product(range(model.joints), EFFECT_KINDS)], load, usual)
        turns = _Turns(model, parts, every, fit.weights, better)
        before = chosen
        chosen = _chosen(turns, before) if wanted is None else before
        if not chosen:
            return None, []
        change = turns.fitted(chosen, turns.whole)[: model.moved] - load
        load = load + change
        moved = np.sqrt((_squares(plain, change) / np.maximum(plain.energy, TINY)).max())
        if chosen == before and (moved < _SETTLED or not any(kind == "load" for _, kind in chosen)):
            break
    each = [Effect(*key, turns.worth(key, chosen)) for key in sorted(chosen)]
    return Effects(sorted(chosen), load, usual), each


def _parts(recordings: Sequence[Sequence[Measurements]]) -> list[Measurements]:
    """Samples of each recording, or of equal stretches of a single one."""
    whole = [subsample(recording, _SAMPLES // len(recordings)) for recording in recordings]
    if len(whole) > 1:
        return whole
    cuts = np.linspace(0, len(whole[0]), _STRETCHES + 1).astype(int).tolist()
    return [whole[0][begin:end] for begin, end in pairwise(cuts)]


def _squares(sums: Sums, parameters: Array) -> Array:
    """Squared torque of the first parameters, summed over samples, (J,)."""
    count = len(parameters)
    return sums.information[:, :count, :count] @ parameters @ parameters


class _Turns:
    """Fits of a model with some of all effects to all parts but one, and their errors on that one."""

    def __init__(
        self, model: TorqueModel, parts: list[Measurements], every: Effects, weights: Array, better: float
    ) -> None:
        full = TorqueModel(model.body, model.terms, every)
        self.model, self.weights, self.better = model, weights, better
        self.parts = [gather(full, part).sums for part in parts]
        self.whole = reduce(Sums.plus, self.parts)
        self.forms = len(every.columns) // model.joints

    def most(self, kind: str) -> float:
        """Largest ratio of errors with and without an effect at which it is kept."""
        return self.better ** max(1.0, len(PLACES[kind]) / _FORMS)

    def columns(self, chosen: Sequence[Key]) -> list[int]:
        """The model's own columns, and those of effects."""
        count = self.model.count
        return [*range(count), *(count + j * self.forms + k for j, kind in chosen for k in PLACES[kind])]

    def fitted(self, chosen: Sequence[Key], sums: Sums) -> Array:
        """Parameters of the model and of effects."""
        information, moment = sums.weighted(self.weights)
        columns = self.columns(chosen)
        return solve(information[np.ix_(columns, columns)], moment[columns], LEAST)[0]

    def errors(self, chosen: Sequence[Key]) -> Array:
        """Squared errors of each joint in each part by a model of the others, and in all, (parts + 1, J)."""
        others = [Sums(*(a - b for a, b in zip(self.whole, part))) for part in self.parts]
        rows = []
        for part, learned in zip([*self.parts, self.whole], [*others, self.whole]):
            parameters = np.zeros(part.moment.shape[1])
            parameters[self.columns(chosen)] = self.fitted(chosen, learned)
            rows.append(np.maximum(part.squares(parameters), TINY))
        return np.stack(rows)

    def worth(self, key: Key, chosen: Sequence[Key]) -> float:
        """Ratio of a joint's errors on data held out with all chosen effects to those without one of them."""
        ratio = self.errors(chosen) / self.errors([other for other in chosen if other != key])
        return float(gmean(ratio[:-1])[key[0]])


def _chosen(turns: _Turns, chosen: list[Key]) -> list[Key]:
    """These effects and those that lower errors beside them, without those that become superfluous."""
    joints = range(turns.model.joints)
    while True:
        best = turns.errors(chosen)
        ratios: dict[Key, float] = {}
        for kind in EFFECT_KINDS:
            new = [(j, kind) for j in joints if (j, kind) not in chosen]
            ratio = turns.errors([*chosen, *new]) / best
            mean = gmean(ratio[:-1])  # over the parts
            clear = (ratio < 1).all(0) & (np.maximum(mean, ratio[-1]) < turns.most(kind))
            ratios |= {key: float(mean[key[0]]) for key in new if clear[key[0]]}
        each = [[key for key in ratios if key[0] == j] for j in joints]
        picks = [min(keys, key=ratios.__getitem__) for keys in each if keys]
        if not picks:
            break
        chosen = [*chosen, *picks]
    while worth := {key: turns.worth(key, chosen) / turns.most(key[1]) for key in chosen}:
        least = max(worth, key=worth.__getitem__)
        if worth[least] < 1:
            break
        chosen = [key for key in chosen if key != least]
    return chosen
