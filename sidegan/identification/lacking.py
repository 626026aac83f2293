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
_LOST = 1e-6  # of what forms leave of one another: they are separate above that


class Kind(NamedTuple):
    """A kind of torque that models lack."""

    name: str
    forms: tuple[int, ...]  # of ``unmodelled``
    motion: str  # that shows it, of a joint


KINDS = (
    Kind("friction near rest", (0,), "slow reversals of {joint}"),
    Kind("friction that grows with the load", (1,), "{joint} under small and large loads, equally fast"),
    Kind("friction that bends with the speed", (2,), "{joint} at several constant speeds, slow ones too"),
    Kind("friction that differs between directions", (3,), "{joint} there and back at equal speeds"),
    Kind("friction that depends on the position", (12, 13), "{joint} slowly over its whole range"),
    Kind("torque that depends on the position", (4, 5, 6, 7), "{joint} slowly over its whole range"),
    Kind("ripple", (8, 9, 10, 11), "{joint} slowly, at constant speed"),
)


def unmodelled(q: Tensor, dq: Tensor, torque: Tensor, scale: Tensor) -> Tensor:
    """Torques that models lack, in the order of ``KINDS``' forms, each of size one, (…, J, K).

    At positions, velocities and torques (…, J) of joints whose usual torque is the scale, (J,).
    """
    s, root = torch.tanh(dq / _SHARP), (dq * dq + 1e-4) ** 0.25
    waves = [f(n * q) for n in (2, 8, 20, 100) for f in (torch.sin, torch.cos)]
    size = torque / scale
    forms = [s * torch.exp(-((dq / 0.1) ** 2)), s * torch.tanh(3 * size) * size]
    forms += [s * root, s * dq, *waves, s * torch.sin(2 * q), s * torch.cos(2 * q)]
    return torch.stack(forms, -1)


class Lack(NamedTuple):
    """A kind of torque that one joint shows and the model lacks."""

    joint: int
    kind: Kind
    share: float  # of the variance of the joint's residuals


@dataclass(frozen=True)
class Lacks:
    """Torques that a model lacks."""

    found: tuple[Lack, ...]  # by joints, of each joint the one that explains most first
    error: Tensor  # that it makes at usual states, root mean square over each joint's usual torque, (J,)

    def of(self, joint: int) -> list[Lack]:
        """Kinds of one joint."""
        return [one for one in self.found if one.joint == joint]

    def sentences(self, names: Sequence[str], noise: Tensor) -> list[str]:
        """A sentence for each joint that lacks something, beside the error that noise makes, (J,)."""
        sentences = []
        for j, name in enumerate(names):
            if own := self.of(j):
                first, *more = [f"{one.share:.0%} {one.kind.name}" for one in own]
                kinds = listed([first.replace("%", "% of what is left is", 1), *more], _MOST)
                error, beside = float(self.error[j]), float(noise[j])
                sentences.append(
                    f"{name}: {kinds}, and no noise; torques of other motions err by "
                    f"{error:.1%} for what the model lacks and by {beside:.1%} for noise: "
                    f"{BIASED if error > beside else 'noise dominates'}"
                )
        return sentences or ["no known misfit explains more of it than noise would: more motion helps"]

    def motions(self, names: Sequence[str], noise: Tensor) -> list[str]:
        """Motions that help where bias dominates, each with the joints that ask for it."""
        asked: dict[str, list[str]] = {}
        for one in self.found:
            if self.error[one.joint] > noise[one.joint]:
                asked.setdefault(one.kind.motion, []).append(names[one.joint])
        return [motion.format(joint=listed(joints, len(joints))) for motion, joints in asked.items()]


def lacks(model: TorqueModel, estimate: Estimate, samples: Samples) -> Lacks:
    """Torques that an estimate's model lacks, as its residuals show them.

    A kind counts where it explains several times as much of them as noise of their size and correlation
    would let it by chance. The samples, which are read once, are those of the estimate.
    """
    sums, chance = _Sums.over(model, estimate, samples), estimate.inflation / estimate.samples
    each = [sums.explained(j, float(chance[j])) for j in range(model.joints)]
    amounts = torch.stack([one for _, one in each])  # (J, K)
    states = model.usual_states()
    rows = model.regressor(*states)
    torque = rows @ estimate.parameters
    still = Measurements(*states, torque)
    error = torch.einsum("sjk,jk->sj", _forms(model, estimate, rows, still), amounts)
    error = error - rows @ torch.einsum("pjk,jk->p", sums.turned, amounts)
    usual = torque.square().mean(0).clamp_min(torch.finfo(torch.float64).tiny)
    return Lacks(tuple(one for found, _ in each for one in found), (error.square().mean(0) / usual).sqrt())


@dataclass(frozen=True)
class _Sums:
    """Products of the forms with the model's columns and with the residuals."""

    turned: Tensor  # B: parameters that a unit of each form turns into, (P, J, K)
    normal: Tensor  # products of what the forms of a joint leave there, (J, K, K)
    right: Tensor  # their products with its residuals, (J, K)
    energy: Tensor  # squares of these, (J,)

    @classmethod
    def over(cls, model: TorqueModel, estimate: Estimate, samples: Samples) -> "_Sums":
        """Sums over the samples."""
        information, weights = estimate.sums.information, estimate.weights.square()
        moments, along, across, right, energy = _products(model, estimate, samples)
        inverse = scaled_inverse(estimate.sums.weighted(estimate.weights)[0], _ROUNDING)
        wrong = torch.einsum("pq,j,jqk->pjk", inverse, weights, moments)
        crossed = torch.einsum("jpk,pjl->jkl", moments, wrong)
        kept = torch.einsum("pjk,jpq,qjl->jkl", wrong, information, wrong)
        left = across - torch.einsum("pjk,jp->jk", wrong, along)
        return cls(wrong, right - crossed - crossed.mT + kept, left, energy)

    def explained(self, joint: int, chance: float) -> tuple[list[Lack], Tensor]:
        """Kinds that a joint shows, and how much of each form, (K,); a form explains this share by chance."""
        kinds, gains, whole = list(KINDS), list[Lack](), float(self.energy[joint])
        chosen: list[int] = []
        reached, amounts = 0.0, torch.zeros_like(self.right[joint])
        while whole > 0 and len(gains) < _MOST:
            values = {kind: self._reached(joint, [*chosen, *kind.forms])[0] for kind in kinds}
            best = max(values, key=values.__getitem__)
            share = (values[best] - reached) / whole
            if share < max(_LEAST, _CHANCE * chance * len(best.forms)):
                break
            chosen += best.forms
            kinds.remove(best)
            gains.append(Lack(joint, best, share))
            reached, amounts[chosen] = self._reached(joint, chosen)
        return gains, amounts

    def _reached(self, joint: int, forms: list[int]) -> tuple[float, Tensor]:
        """Squares of the residuals that forms explain, and how much there is of each."""
        normal, right = self.normal[joint][forms][:, forms], self.right[joint][forms]
        amounts = scaled_inverse(normal, _LOST) @ right
        return float(amounts @ right), amounts


def _products(model: TorqueModel, estimate: Estimate, samples: Samples) -> list[Tensor]:
    """Σ Yᵀ b, Σ Yᵀ r, Σ b r, Σ b bᵀ and Σ r² of each joint's forms b and residuals r."""
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
    return sums


def _forms(model: TorqueModel, estimate: Estimate, y: Tensor, part: Measurements) -> Tensor:
    """Forms that the model may lack at samples with a regressor, (S, J, K)."""
    rigid = y[..., : model.rigid] @ estimate.parameters[: model.rigid]
    return unmodelled(part.position.double(), part.velocity.double(), rigid, _scale(estimate))


def _scale(estimate: Estimate) -> Tensor:
    """Root mean square torque of each joint in the samples, (J,)."""
    return (estimate.sums.energy / estimate.sums.weight).clamp_min(torch.finfo(torch.float64).tiny).sqrt()
