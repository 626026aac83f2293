"""Torques that a model lacks, from its residuals: their kinds, sizes, and the errors that they make.

A torque b that a model lacks turns least squares' parameters by B b, so that b − Y B b is what it leaves in
the residuals, and the same at other states is the error that it makes there. More motion of the same kind
makes noise's part smaller, and not that one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.identification.estimate import Estimate
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel, torques_of
from sidegan.identification.sums import scaled_inverse

BIASED = "bias dominates"

_SHARP = 0.03  # [rad/s] of the smooth sign of friction
_CHANCE = 4.0  # times what noise alone would explain: less is no finding
_LEAST = 0.05  # share of a joint's residuals that a kind explains at least
_MOST = 3  # kinds of one joint
_ROUNDING = 1e-10
_TINY = np.finfo(float).tiny
_LOST = 1e-6  # of what forms leave of one another: they are separate above that


# Kinds of torque that models lack, by the forms of ``unmodelled``.
KINDS = {
    "friction near rest": (0,),
    "friction that grows with the load": (1,),
    "nonlinear viscous friction": (2,),
    "friction that differs between directions": (3,),
    "friction that depends on the position": (12, 13),
    "torque that depends on the position": (4, 5, 6, 7),
    "ripple": (8, 9, 10, 11),
}


def unmodelled(q: Array, dq: Array, torque: Array, usual: Array) -> Array:
    """Torques that models lack, in the order of ``KINDS``' forms, each of size one, (…, J, K).

    At positions, velocities and torques (…, J) of joints whose usual torque is ``usual``, (J,).
    """
    s = np.tanh(dq / _SHARP)
    root = (dq * dq + 1e-4) ** 0.25
    waves = [f(n * q) for n in (2, 8, 20, 100) for f in (np.sin, np.cos)]
    size = torque / usual
    forms = [s * np.exp(-((dq / 0.1) ** 2)), s * np.tanh(3 * size) * size]
    forms += [s * root, s * dq, *waves, s * np.sin(2 * q), s * np.cos(2 * q)]
    return np.stack(forms, -1)


class Lack(NamedTuple):
    """A kind of torque that one joint shows and the model lacks."""

    joint: int
    kind: str  # of ``KINDS``
    share: float  # of the variance of the joint's residuals


@dataclass(frozen=True)
class Unmodelled:
    """Torques that a model lacks."""

    found: tuple[Lack, ...]  # by joints, of each joint the one that explains most first
    error: Array  # that it makes at usual states, root mean square over each joint's usual torque, (J,)

    def sentences(self, names: Sequence[str], noise: Array) -> list[str]:
        """A sentence for each joint that lacks something, beside the error that noise makes, (J,)."""
        sentences = []
        for j, name in enumerate(names):
            if own := [f"{one.share:.0%} {one.kind}" for one in self.found if one.joint == j]:
                own[0] = own[0].replace("%", "% of the residual is", 1)
                error, beside = self.error[j], noise[j]
                sentences.append(
                    f"{name}: {listed(own, _MOST)}, more than noise explains; torque errors in other motions:"
                    f" {error:.1%} from unmodelled effects, {beside:.1%} from noise: "
                    f"{BIASED if error > beside else 'noise dominates'}"
                )
        return sentences or [
            "no known effect explains more of the residual than noise would: more motion helps"
        ]


def find_unmodelled(model: TorqueModel, estimate: Estimate, samples: Samples) -> Unmodelled:
    """Torques that an estimate's model lacks, as its residuals show them.

    A kind counts where it explains several times as much of them as noise of their size and correlation
    would let it by chance. The samples, which are read once, are those of the estimate.
    """
    turned, left = _left(model, estimate, samples)
    each = [_explained(one, x) for one, x in zip(left, estimate.inflation / estimate.samples)]
    found = [Lack(j, *kind) for j, (kinds, _) in enumerate(each) for kind in kinds]
    amounts = np.stack([one for _, one in each])
    states = model.usual_states()
    rows = model.regressor(*states)
    torque = rows @ estimate.parameters
    forms = _forms(model, estimate, rows, Measurements(*states, torque))
    error = (forms * amounts).sum(2) - rows @ np.einsum("jpk,jk->p", turned, amounts)
    usual = np.maximum(np.square(torque).mean(0), _TINY)
    return Unmodelled(tuple(found), np.sqrt(np.square(error).mean(0) / usual))


class _Left(NamedTuple):
    """Products over samples of what the model leaves of a joint's forms."""

    normal: Array  # its products, (K, K)
    right: Array  # its products with the residuals, (K,)
    energy: Array  # squares of these, ()

    def by(self, forms: list[int]) -> tuple[float, Array]:
        """Squares of the residuals that forms explain, and how much there is of each."""
        amounts = scaled_inverse(self.normal[forms][:, forms], _LOST) @ self.right[forms]
        return float(amounts @ self.right[forms]), amounts


def _explained(left: _Left, chance: float) -> tuple[list[tuple[str, float]], Array]:
    """Kinds with the shares that they explain, more than by chance, and how much of each form, (K,)."""
    found: dict[str, float] = {}
    chosen: list[int] = []
    reached = 0.0
    amounts = np.zeros_like(left.right)
    while left.energy > 0 and len(found) < _MOST:
        values = {kind: left.by([*chosen, *forms])[0] for kind, forms in KINDS.items() if kind not in found}
        best = max(values, key=values.__getitem__)
        share = (values[best] - reached) / float(left.energy)
        if share < max(_LEAST, _CHANCE * chance * len(KINDS[best])):
            break
        found[best] = share
        chosen += KINDS[best]
        reached, amounts[chosen] = left.by(chosen)
    return [*found.items()], amounts


def _left(model: TorqueModel, estimate: Estimate, samples: Samples) -> tuple[Array, list[_Left]]:
    """Parameters B that a unit of each joint's forms turns into, (J, P, K), and what the forms leave."""
    moments = products = np.zeros(())  # of columns with the regressor, (J, P, K + 1), and with themselves
    for part in pieces(samples):
        y = model.regressor(*part.inputs)
        residual = part.torque - torques_of(y, estimate.parameters)
        columns = np.concatenate([_forms(model, estimate, y, part), residual[..., None]], 2).swapaxes(0, 1)
        moments = moments + y.transpose(1, 2, 0) @ columns
        products = products + columns.mT @ columns
    moments, along = moments[..., :-1], moments[..., -1:]
    inverse = scaled_inverse(estimate.sums.weighted(estimate.weights)[0], _ROUNDING)
    turned = inverse @ (np.square(estimate.weights)[:, None, None] * moments)
    crossed, kept = moments.mT @ turned, turned.mT @ estimate.sums.information @ turned
    normal = products[:, :-1, :-1] - crossed - crossed.mT + kept
    right = products[:, :-1, -1] - (turned.mT @ along)[..., 0]
    return turned, [_Left(*one) for one in zip(normal, right, products[:, -1, -1])]


def _forms(model: TorqueModel, estimate: Estimate, y: Array, part: Measurements) -> Array:
    """Forms that the model may lack at samples with a regressor, (S, J, K)."""
    rigid = torques_of(y[..., : model.rigid], estimate.parameters[: model.rigid])
    usual = np.sqrt(np.maximum(estimate.sums.energy / estimate.sums.weight, _TINY))
    return unmodelled(part.position, part.velocity, rigid, usual)
