"""Which gravity a recording's torques hold, and at which scale, by the inertias of the description."""

import math
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import SIGN_WIDTH

_ROUNDS = 10  # of scales and gravity in turn
_BETTER = 0.7  # share of what the description's gravity leaves, from which on another one is believed
_EXPLAINED = 0.5  # of the median joint's variance is left at most by a gravity that is believed
_LEAST = 1e-2  # of a joint's torque that is taken for noise at least
_TURNED = 0.26  # [rad] between two directions that are not one and the same
_TINY = 1e-12


class Load(NamedTuple):
    """The gravity with which a description explains torques best, and the factors to its torques."""

    gravity: Tensor  # in the world [m/s²], (3,); the description's own unless another one is far better
    # of each joint, (J,): measured over described torque, both without what friction and rotors can explain
    scale: Tensor
    correlation: Tensor  # of the same two, −1 to 1, (J,); 0 where the description needs no torque
    left: Tensor  # share of each joint's variance that is left, (J,)

    @property
    def misfit(self) -> float:
        """Geometric mean of what is left, so that joints count alike however much noise they have."""
        return float(self.left.clamp_min(_TINY).log().mean().exp())


class _Torques:
    """Measured torques beside the described ones by their origin, without what friction and rotors explain.

    All are (S, J), those of gravity (S, J, 3) for 1 m/s² along each axis of the world.
    """

    def __init__(self, body: RigidBody, q: Tensor, v: Tensor, a: Tensor, measured: Tensor) -> None:
        still, none = torch.zeros_like(q), torch.zeros(3, dtype=torch.float64)
        axes = torch.eye(3, dtype=torch.float64)
        inertial = RigidBody(replace(body.arm, gravity=none)).torque(q, v, a)
        static = [RigidBody(replace(body.arm, gravity=g)).torque(q, still, still) for g in axes]
        columns = torch.cat([inertial[..., None], torch.stack(static, -1), measured[..., None]], -1)
        self.size = (inertial.square().sum(0) + columns[..., 1:4].square().sum((0, 2))).sqrt()
        basis = orthonormal(other_columns(v, a).transpose(0, 1))  # (J, S, 4)
        columns -= (basis @ (basis.mT @ columns.transpose(0, 1))).transpose(0, 1)
        self.inertial, self.static, self.measured = columns[..., 0], columns[..., 1:4], columns[..., 4]
        self.weight = 1 / self.measured.norm(dim=0).clamp_min(_TINY)

    def explained(self, gravity: Tensor) -> Load:
        """Scales of the joints with a gravity [m/s²], (3,)."""
        model = self.inertial + self.static @ gravity
        products, squares = (model * self.measured).sum(0), model.square().sum(0)
        seen = squares.sqrt() > 1e-9 * self.size.clamp_min(_TINY)
        scale = torch.where(seen, products / squares.clamp_min(_TINY**2), 0.0)
        cosine = torch.where(seen, products / squares.sqrt().clamp_min(_TINY) * self.weight, 0.0)
        return Load(gravity, scale, cosine, 1 - cosine.square())

    def towards(self, scale: Tensor, left: Tensor) -> Tensor:
        """Gravity [m/s²], (3,), that explains most at these scales, where so much is left, (J,) each."""
        weight = self.weight / left.sqrt().clamp_min(_LEAST)
        rows = (self.static * (scale * weight)[:, None]).flatten(0, 1)
        rest = ((self.measured - scale * self.inertial) * weight).flatten()
        return torch.linalg.lstsq(rows, rest[:, None], driver="gelsd").solution[:, 0]


def load_of(body: RigidBody, q: Tensor, v: Tensor, a: Tensor, measured: Tensor) -> Load:
    """Gravity and scales of measured torques (S, J) at states (S, J), by an arm's description.

    Whether masses or gravity are larger cannot be told, so that its size is the description's, or nothing.
    Another one is believed where both halves of the samples say the same.
    """
    states = q, v, a, measured
    torques, described = _Torques(body, *states), body.arm.gravity
    best = _best(torques, described)
    if best is not None:
        halves = zip(*(x.chunk(2) for x in states))
        found = [_best(_Torques(body, *half), described) for half in halves]
        if all(one is not None and _alike(one.gravity, best.gravity) for one in found):
            return best
    return torques.explained(described)


def _best(torques: _Torques, described: Tensor) -> Load | None:
    """With the gravity [m/s²], (3,), that explains torques far better than the described one, if any does."""
    size, as_described = float(described.norm()), torques.explained(described)
    if not size > 0:
        return None
    found = _other_direction(torques, size)
    others = [torques.explained(torch.zeros_like(described))]
    others += [] if _alike(found.gravity, described) else [found]
    best = min(others, key=lambda one: one.misfit)
    believed = best.misfit < _BETTER * as_described.misfit and float(best.left.median()) < _EXPLAINED
    return best if believed else None


def _alike(one: Tensor, other: Tensor) -> bool:
    """Whether two gravities, (3,), have one direction, or are none."""
    sizes = float(one.norm() * other.norm())
    return float(one @ other) > sizes * math.cos(_TURNED) if sizes > 0 else torch.equal(one, other)


def _other_direction(torques: _Torques, size: float) -> Load:
    """The gravity of this size [m/s²] that explains most."""
    left = torch.ones_like(torques.weight)
    scale = 1 / (torques.weight * torques.size.clamp_min(_TINY))  # whatever the unit of each joint's torque
    found = []
    for _ in range(_ROUNDS):
        gravity = torques.towards(scale, left)
        found.append(torques.explained(gravity * size / gravity.norm().clamp_min(_TINY)))
        scale, left = found[-1].scale, found[-1].left
    return min(found, key=lambda one: one.misfit)


def other_columns(velocity: Tensor, acceleration: Tensor) -> Tensor:
    """Viscous and Coulomb friction, offset and rotor inertia of joints, (…, 4), at states (…)."""
    sign = torch.tanh(velocity / SIGN_WIDTH)
    return torch.stack([velocity, sign, torch.ones_like(velocity), acceleration], -1)


def orthonormal(columns: Tensor) -> Tensor:
    """Orthonormal basis (…, S, k) of what columns (…, S, k) can explain."""
    return torch.linalg.qr(columns / columns.norm(dim=-2, keepdim=True).clamp_min(_TINY)).Q
