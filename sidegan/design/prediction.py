"""Design for the held-out error itself: variance, plus bias from what the identified model lacks.

Weighted least squares with information A = prior + Σ w Yᵀ Y turns a torque b that the model lacks into
parameters X = A⁻¹ Σ w Yᵀ b, and on tasks into an error b − Y X. With T the tasks' mean YᵀY over squared
torques, X* the parameters that are best on the tasks, and a size c for each misfit, the expected squared
error above what the best parameters of the model reach is

    tr(T A⁻¹) + Σ c² (X − X*)ᵀ T (X − X*) + Σ over recordings c² mᵀ A⁻¹ T A⁻¹ m,

the last for what changes from one recording to the next, with m = Σ w Yᵀ b of a recording alone.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor
from torch.nn.functional import pad

from sidegan.base.typed import NonNegative, Positive, Seconds
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody

_SHARP = 0.03  # [rad/s] of the smooth sign of misfits
_LEFT = 0.5  # share of friction that residuals of an identification are taken for, beside noise
_LEAST = 1e-9  # of the largest eigenvalue of the tasks' information, below which they tell nothing


# What a model lacks: fields of ``Misfits`` that zero switches off.
LACKING = ("stribeck", "load", "power", "asymmetry", "position", "wave", "ripple", "drift", "bias")


class Linear(Protocol):
    """A model of torque that is linear in P parameters: rigid body first, then terms of single joints."""

    body: RigidBody
    extras: Tensor  # term · J + joint of each of the latter

    @property
    def count(self) -> int:
        """Number of parameters P."""

    @property
    def terms(self) -> Any:
        """The terms: their ``kinds`` and ``sign_width``, and ``signals(dq, ddq, stribeck)``."""

    @property
    def stribeck(self) -> Tensor | None:
        """Velocity of each joint's Stribeck term, (J,); None without it."""


@dataclass(frozen=True)
class Misfits:
    """Sizes of what the model lacks, and of noise; shares of each joint's torque, zero for none."""

    noise: Positive  # standard deviation of the measured torque
    correlation: Seconds  # time over which that noise keeps its sign
    friction: Positive  # Coulomb friction, of which the next ones are shares
    stribeck: NonNegative  # extra friction near rest
    load: NonNegative  # friction that grows with the transmitted torque
    power: NonNegative  # friction with the root of the speed
    asymmetry: NonNegative  # friction whose slope differs between the directions
    position: NonNegative  # friction that changes with the joint's position
    wave: NonNegative  # torque that changes slowly with the joint's position, of the torque
    ripple: NonNegative  # torque that changes fast with it, of the torque
    drift: NonNegative  # change of friction from one recording to the next
    bias: NonNegative  # change of the sensor's offset from one recording to the next, of the torque

    def amplitudes(self, scale: Tensor) -> tuple[Tensor, Tensor]:
        """Squared sizes of lasting misfits, (J, K), and of those of single recordings, (J, 3)."""
        f = self.friction
        lasting = [f * self.stribeck, self.load, f * self.power, f * self.asymmetry]
        lasting += [self.wave] * 4 + [self.ripple] * 4 + [f * self.position] * 2
        passing = [f * self.drift, f * self.drift / 2, self.bias]
        return tuple((scale[:, None] * scale.new_tensor(x)) ** 2 for x in (lasting, passing))  # type: ignore[return-value]


class Rows(NamedTuple):
    """Of S states: the model's regressor (S, J, P); lasting and passing misfits (S, J, K), (S, J, 3)."""

    regressor: Tensor
    lasting: Tensor
    passing: Tensor


class Told(NamedTuple):
    """What a recording, or several, tell: sums over them (…)."""

    information: Tensor  # (…, P, P)
    lasting: Tensor  # Σ w Yᵀ b, (…, P, J K)
    passing: Tensor  # the same of single recordings times its size, (…, P, 3 J)


class Prediction:
    """Expected squared error on tasks of what is identified from trajectories, one after another.

    Args:
        model: what is identified.
        tasks: position, velocity, acceleration of the tasks, (S, J) each.
        scale: torque of the joints [N·m or N], (J,), of which sizes are shares.
        misfits: the sizes.
        belief: information of what is known before, (P, P), positive definite.

    Attributes:
        per_second: one over the variance of a mean over a second of each joint's torque, (J,).
        known: what trajectories tell that are known.
    """

    def __init__(
        self,
        model: Linear,
        tasks: tuple[Tensor, Tensor, Tensor],
        scale: Tensor,
        misfits: Misfits,
        belief: Tensor,
    ) -> None:
        self.model, self.scale, self.misfits = model, scale, misfits
        self._lasting, self._passing = misfits.amplitudes(scale)
        # What is left over has misfits in it: equations are weighted by that, as after an identification, and
        # the variance is that of errors of this size, more than noise alone would make.
        spread = scale * (misfits.noise**2 + (_LEFT * misfits.friction) ** 2) ** 0.5
        self.per_second = 1 / (2 * misfits.correlation * spread**2)
        rows = self.rows(*tasks)
        share = 1 / (scale**2 * rows.regressor[:, :, 0].numel())
        y = rows.regressor * share[:, None]
        self.tasks = torch.einsum("sjp,sjq->pq", y, rows.regressor)
        values, vectors = torch.linalg.eigh(self.tasks)
        kept = values > _LEAST * values[-1]
        inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
        self.best = inverse @ _moments(y, rows.lasting)  # X*, (P, J K)
        self.root = vectors[:, kept] * values[kept].sqrt()  # T = root rootᵀ
        self.known = Told(belief.clone(), torch.zeros_like(self.best), torch.zeros_like(belief))

    def rows(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Rows:
        """Regressor and misfits at states (S, J), differentiable in them."""
        base, rigid = self.model.body.base, self.model.body.base_regressor(q, dq, ddq)
        torque = rigid @ base.values.to(q)
        return Rows(with_terms(self.model, rigid, dq, ddq), lacking(q, dq, torque, self.scale), _passing(dq))

    def told(self, q: Tensor, dq: Tensor, ddq: Tensor, seconds: float) -> Told:
        """What B trajectories of so many seconds tell, each alone, of their states (B, T, J)."""
        batch, count, joints = q.shape
        rows = self.rows(*(x.reshape(-1, joints) for x in (q, dq, ddq)))
        y, lasting, passing = (x.unflatten(0, (batch, count)) for x in rows)
        weighted = y * (self.per_second * seconds / count)[:, None]
        information = weighted.flatten(1, 2).mT @ y.flatten(1, 2)
        moments = (_moments(weighted, b) for b in (lasting, passing))
        return Told(information, next(moments), next(moments) * self._passing.flatten().sqrt())

    def value(self, new: Told) -> Tensor:
        """Logarithm of the expected error after each of B trajectories beside those that are known, (B,)."""
        known = self.known
        factor = torch.linalg.cholesky(known.information + new.information)
        noise, lasting, passing = self._errors(factor, known.lasting + new.lasting, new.passing)
        return (noise + lasting + passing).log()

    def _errors(self, factor: Tensor, lasting: Tensor, passing: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The error's three parts, (B,), of the factor of A (B, P, P) and the moments."""
        carried = torch.cholesky_solve(self.root.expand(len(factor), -1, -1), factor)  # A⁻¹ root
        noise = (self.root * carried).sum((1, 2))
        off = carried.mT @ lasting - self.root.mT @ self.best
        bias = (off.square() * self._lasting.flatten()).sum((1, 2))
        known = (carried.mT @ self.known.passing @ carried).diagonal(dim1=1, dim2=2).sum(1)
        return noise, bias, known + (carried.mT @ passing).square().sum((1, 2))

    def believe(self, information: Tensor, rate: Tensor) -> None:
        """Begin anew from an identification.

        Args:
            information: on the parameters, (P, P).
            rate: information of a second of torque, one over the variance of a mean over it, (J,).
        """
        self.per_second = rate
        self.known = Told(information.clone(), torch.zeros_like(self.best), torch.zeros_like(information))

    def parts(self) -> tuple[float, float, float]:
        """Expected squared error of what is known now: from noise, from lasting and from passing misfits."""
        factor = torch.linalg.cholesky(self.known.information)[None]
        none = self.known.lasting.new_zeros(1, len(self.tasks), 1)
        noise, lasting, passing = self._errors(factor, self.known.lasting[None], none)
        return float(noise), float(lasting), float(passing)

    def take(self, new: Told) -> None:
        """Count one trajectory as known, of its ``told`` alone, (1, …)."""
        if len(new.information) != 1:
            raise ShapeError(f"{len(new.information)} trajectories cannot be taken at once, expected one")
        known, (information, lasting, passing) = self.known, (x[0].detach() for x in new)
        both = known.passing + passing @ passing.T
        self.known = Told(known.information + information, known.lasting + lasting, both)


def beside(aims: Sequence["Prediction"], times: int) -> "Prediction":
    """One aim for batches in which each of several aims has so many trajectories in a row.

    The aims are of one model and one family of misfits; their tasks and what they know differ.
    """
    if len(aims) == 1:
        return aims[0]
    both, widest = copy(aims[0]), max(one.root.shape[1] for one in aims)
    both.root = _in_a_row([pad(one.root, (0, widest - one.root.shape[1])) for one in aims], times)
    both.best = _in_a_row([one.best for one in aims], times)
    both.known = Told(*(_in_a_row(x, times) for x in zip(*(one.known for one in aims))))
    return both


def _in_a_row(parts: Sequence[Tensor], times: int) -> Tensor:
    """Tensors (…) as a batch in which each comes so many times, (len(parts) · times, …)."""
    return torch.stack(list(parts)).repeat_interleave(times, 0)


def lacking(q: Tensor, dq: Tensor, torque: Tensor, scale: Tensor) -> Tensor:
    """What models lack lastingly, in the order of ``Misfits.amplitudes``, each of size one, (…, J, K).

    At positions, velocities and torques (…, J) of joints whose usual torque is the scale, (J,).
    """
    s, root = torch.tanh(dq / _SHARP), (dq * dq + 1e-4) ** 0.25
    waves = [f(n * q) for n in (2, 8, 20, 100) for f in (torch.sin, torch.cos)]
    size = torque / scale
    forms = [s * torch.exp(-((dq / 0.1) ** 2)), s * torch.tanh(3 * size) * size]
    forms += [s * root, s * dq, *waves, s * torch.sin(2 * q), s * torch.cos(2 * q)]
    return torch.stack(forms, -1)


def with_terms(model: Linear, rigid: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
    """A model's regressor (S, J, P) from that of its rigid bodies (S, J, R), differentiable in all."""
    if not len(model.extras):
        return torch.cat([rigid], 2)
    joints = dq.shape[1]
    signals = torch.stack(model.terms.signals(dq, ddq, model.stribeck))
    term, joint = model.extras // joints, model.extras % joints
    own = torch.nn.functional.one_hot(joint, joints).T.to(dq)  # (J, E)
    return torch.cat([rigid, own * signals[term, :, joint].T[:, None]], 2)


class Volume(Prediction):
    """Minus the mean log eigenvalue of A in place of the error: D-optimal design of the same model."""

    def value(self, new: Told) -> Tensor:
        """The criterion after each of B trajectories beside those that are known, (B,)."""
        factor = torch.linalg.cholesky(self.known.information + new.information)
        return -2 * factor.diagonal(dim1=1, dim2=2).log().mean(1)


def _moments(weighted: Tensor, b: Tensor) -> Tensor:
    """Σ w Yᵀ b of rows w Y (…, S, J, P) and misfits of single joints (…, S, J, K), (…, P, J K)."""
    return torch.einsum("...sjp,...sjk->...pjk", weighted, b).flatten(-2)


def _passing(dq: Tensor) -> Tensor:
    s = torch.tanh(dq / _SHARP)
    return torch.stack([s, dq, torch.ones_like(dq)], 2)
