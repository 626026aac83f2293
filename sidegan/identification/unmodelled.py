"""Torques that a model lacks, from its residuals: their kinds, sizes, and the errors that they make.

A torque b that a model lacks turns least squares' parameters by B b, so that b − Y B b is what it leaves in
the residuals, and the same at other states is the error that it makes there. More motion of the same kind
makes noise's part smaller, and not that one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.base.names import listed
from sidegan.identification.estimate import Estimate
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import scaled_inverse

BIASED = "bias dominates"

_SHARP = 0.03  # [rad/s] of the smooth sign of friction
_CHANCE = 4.0  # times what noise alone would explain: less is no finding
_LEAST = 0.05  # share of a joint's residuals that a kind explains at least
_MOST = 3  # kinds of one joint
_ROUNDING = 1e-10
_TINY = torch.finfo(torch.float64).tiny
_LOST = 1e-6  # of what forms leave of one another: they are separate above that


# Kinds of torque that models lack, by the forms of ``unmodelled``.
KINDS = {
    "friction near rest": (0,),
    "friction that grows with the load": (1,),
    "friction that bends with the speed": (2,),
    "friction that differs between directions": (3,),
    "friction that depends on the position": (12, 13),
    "torque that depends on the position": (4, 5, 6, 7),
    "ripple": (8, 9, 10, 11),
}


def unmodelled(q: Tensor, dq: Tensor, torque: Tensor, usual: Tensor) -> Tensor:
    """Torques that models lack, in the order of ``KINDS``' forms, each of size one, (…, J, K).

    At positions, velocities and torques (…, J) of joints whose usual torque is ``usual``, (J,).
    """
    s, root = torch.tanh(dq / _SHARP), (dq * dq + 1e-4) ** 0.25
    waves = [f(n * q) for n in (2, 8, 20, 100) for f in (torch.sin, torch.cos)]
    size = torque / usual
    forms = [s * torch.exp(-((dq / 0.1) ** 2)), s * torch.tanh(3 * size) * size]
    forms += [s * root, s * dq, *waves, s * torch.sin(2 * q), s * torch.cos(2 * q)]
    return torch.stack(forms, -1)


class Lack(NamedTuple):
    """A kind of torque that one joint shows and the model lacks."""

    joint: int
    kind: str  # of ``KINDS``
    share: float  # of the variance of the joint's residuals


@dataclass(frozen=True)
class Unmodelled:
    """Torques that a model lacks."""

    found: tuple[Lack, ...]  # by joints, of each joint the one that explains most first
    error: Tensor  # that it makes at usual states, root mean square over each joint's usual torque, (J,)

    def sentences(self, names: Sequence[str], noise: Tensor) -> list[str]:
        """A sentence for each joint that lacks something, beside the error that noise makes, (J,)."""
        sentences = []
        for j, name in enumerate(names):
            if own := [f"{one.share:.0%} {one.kind}" for one in self.found if one.joint == j]:
                own[0] = own[0].replace("%", "% of what is left is", 1)
                error, beside = float(self.error[j]), float(noise[j])
                sentences.append(
                    f"{name}: {listed(own, _MOST)}, more than noise explains; torques of other motions err "
                    f"by {error:.1%} for what the model lacks and by {beside:.1%} for noise: "
                    f"{BIASED if error > beside else 'noise dominates'}"
                )
        return sentences or ["no known misfit explains more of it than noise would: more motion helps"]


def find_unmodelled(model: TorqueModel, estimate: Estimate, samples: Samples) -> Unmodelled:
    """Torques that an estimate's model lacks, as its residuals show them.

    A kind counts where it explains several times as much of them as noise of their size and correlation
    would let it by chance. The samples, which are read once, are those of the estimate.
    """
    turned, left = _left(model, estimate, samples)
    each = [_explained(one, float(x)) for one, x in zip(left, estimate.inflation / estimate.samples)]
    found = [Lack(j, *kind) for j, (kinds, _) in enumerate(each) for kind in kinds]
    amounts, states = torch.stack([one for _, one in each]), model.usual_states()
    rows = model.regressor(*states)
    torque = rows @ estimate.parameters
    forms = _forms(model, estimate, rows, Measurements(*states, torque))
    error = torch.einsum("sjk,jk->sj", forms, amounts) - rows @ torch.einsum("pjk,jk->p", turned, amounts)
    usual = torque.square().mean(0).clamp_min(_TINY)
    return Unmodelled(tuple(found), (error.square().mean(0) / usual).sqrt())


class _Left(NamedTuple):
    """Products over samples of what the model leaves of a joint's forms."""

    normal: Tensor  # its products, (K, K)
    right: Tensor  # its products with the residuals, (K,)
    energy: Tensor  # squares of these, ()

    def by(self, forms: list[int]) -> tuple[float, Tensor]:
        """Squares of the residuals that forms explain, and how much there is of each."""
        amounts = scaled_inverse(self.normal[forms][:, forms], _LOST) @ self.right[forms]
        return float(amounts @ self.right[forms]), amounts


def _explained(left: _Left, chance: float) -> tuple[list[tuple[str, float]], Tensor]:
    """Kinds with the shares that they explain, more than by chance, and how much of each form, (K,)."""
    found, chosen, reached, amounts = dict[str, float](), list[int](), 0.0, torch.zeros_like(left.right)
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


def _left(model: TorqueModel, estimate: Estimate, samples: Samples) -> tuple[Tensor, list[_Left]]:
    """Parameters B that a unit of each joint's forms turns into, (P, J, K), and what the forms leave."""
    sums: list[Tensor] = []
    for part in pieces(samples):
        y = model.regressor(*(x.double() for x in part.inputs))
        residual, forms = part.torque - y @ estimate.parameters, _forms(model, estimate, y, part)
        one = [
            torch.einsum("sjp,sjk->jpk", y, forms),
            torch.einsum("sjp,sj->jp", y, residual),
            torch.einsum("sjk,sj->jk", forms, residual),
            torch.einsum("sjk,sjl->jkl", forms, forms),
            residual.square().sum(0),
        ]
        sums = [a + b for a, b in zip(sums, one)] if sums else one
    moments, along, across, products, energy = sums
    inverse = scaled_inverse(estimate.sums.weighted(estimate.weights)[0], _ROUNDING)
    turned = torch.einsum("pq,j,jqk->pjk", inverse, estimate.weights.square(), moments)
    crossed = torch.einsum("jpk,pjl->jkl", moments, turned)
    kept = torch.einsum("pjk,jpq,qjl->jkl", turned, estimate.sums.information, turned)
    right = across - torch.einsum("pjk,jp->jk", turned, along)
    return turned, [_Left(*one) for one in zip(products - crossed - crossed.mT + kept, right, energy)]


def _forms(model: TorqueModel, estimate: Estimate, y: Tensor, part: Measurements) -> Tensor:
    """Forms that the model may lack at samples with a regressor, (S, J, K)."""
    rigid = y[..., : model.rigid] @ estimate.parameters[: model.rigid]
    usual = (estimate.sums.energy / estimate.sums.weight).clamp_min(_TINY).sqrt()
    return unmodelled(part.position.double(), part.velocity.double(), rigid, usual)
