"""Direction of gravity and scales of torque in a recording, from the description's inertias."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array, geometric_mean
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import SIGN_WIDTH

_ROUNDS = 10  # of fitting scales and gravity alternately
_BETTER = 0.7  # misfit relative to the described gravity's below which another gravity is believed
_EXPLAINED = 0.5  # most that a believed gravity leaves of the median joint's variance
_LEAST = 1e-2  # of a joint's torque assumed to be noise at least
_TURNED = 0.26  # [rad] angle between two directions that count as different
_TINY = 1e-12


class Load(NamedTuple):
    """The gravity with which a description explains torques best, and the scales of the torques."""

    gravity: Array  # in the world [m/s²], (3,); the described one unless another is far better
    # measured over described torque of each joint, (J,), both without what friction and rotors can explain
    scale: Array
    correlation: Array  # of the same torques, −1 to 1, (J,); 0 where the described torque is zero
    left: Array  # unexplained share of each joint's variance, (J,)

    @property
    def misfit(self) -> float:
        """Geometric mean of the unexplained shares: all joints count equally, whatever their noise."""
        return geometric_mean(np.maximum(self.left, _TINY))


class _Torques:
    """Measured, inertial and gravity torques, without what friction and rotors explain.

    All are (S, J), but gravity's (S, J, 3): for 1 m/s² along each axis of the world.
    """

    def __init__(self, body: RigidBody, q: Array, v: Array, a: Array, measured: Array) -> None:
        still = np.zeros_like(q)
        none = np.zeros(3)
        inertial = RigidBody(replace(body.arm, gravity=none)).torque(q, v, a)
        static = [RigidBody(replace(body.arm, gravity=g)).torque(q, still, still) for g in np.eye(3)]
        columns = np.concatenate([inertial[..., None], np.stack(static, -1), measured[..., None]], -1)
        self.size = np.sqrt(np.square(inertial).sum(0) + np.square(columns[..., 1:4]).sum((0, 2)))
        columns = unexplained(friction_basis(v, a), columns.swapaxes(0, 1))
        columns = columns.swapaxes(0, 1)
        self.inertial, self.static, self.measured = columns[..., 0], columns[..., 1:4], columns[..., 4]
        self.weight = 1 / np.maximum(np.linalg.norm(self.measured, axis=0), _TINY)

    def explained(self, gravity: Array) -> Load:
        """Joint scales with a gravity [m/s²], (3,)."""
        model = self.inertial + self.static @ gravity
        products, squares = (model * self.measured).sum(0), np.square(model).sum(0)
        seen = np.sqrt(squares) > 1e-9 * np.maximum(self.size, _TINY)
        scale = np.where(seen, products / np.maximum(squares, _TINY**2), 0.0)
        cosine = np.where(seen, products / np.maximum(np.sqrt(squares), _TINY) * self.weight, 0.0)
        return Load(gravity, scale, cosine, 1 - np.square(cosine))

    def towards(self, scale: Array, left: Array) -> Array:
        """Best gravity [m/s²], (3,), at these scales and unexplained shares, (J,) each."""
        weight = self.weight / np.maximum(np.sqrt(left), _LEAST)
        rows = (self.static * (scale * weight)[:, None]).reshape(-1, 3)
        rest = ((self.measured - scale * self.inertial) * weight).ravel()
        return np.linalg.lstsq(rows, rest)[0]


def load_of(body: RigidBody, q: Array, v: Array, a: Array, measured: Array) -> Load:
    """Gravity and scales of measured torques (S, J) at states (S, J), from an arm's description.

    Larger masses cannot be told from larger gravity, so its magnitude is the description's, or zero.
    Another gravity is believed only if both halves of the samples agree on it.
    """
    states = q, v, a, measured
    torques = _Torques(body, *states)
    described = body.arm.gravity
    best = _best(torques, described)
    if best is not None:
        halves = zip(*(np.array_split(x, 2) for x in states))
        found = [_best(_Torques(body, *half), described) for half in halves]
        if all(half is not None and _same_direction(half.gravity, best.gravity) for half in found):
            return best
    return torques.explained(described)


def _best(torques: _Torques, described: Array) -> Load | None:
    """Load with a gravity that explains torques far better than the described one [m/s²]; None if no such."""
    size = float(np.linalg.norm(described))
    if not size > 0:
        return None
    as_described = torques.explained(described)
    found = _other_direction(torques, size)
    others = [torques.explained(np.zeros_like(described))]
    others += [] if _same_direction(found.gravity, described) else [found]
    best = min(others, key=lambda load: load.misfit)
    believed = best.misfit < _BETTER * as_described.misfit and np.median(best.left) < _EXPLAINED
    return best if believed else None


def _same_direction(a: Array, b: Array) -> bool:
    """Whether two gravities, (3,), have nearly the same direction, or are both zero."""
    sizes = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) > sizes * math.cos(_TURNED) if sizes > 0 else np.array_equal(a, b)


def _other_direction(torques: _Torques, size: float) -> Load:
    """Load with the gravity of this magnitude [m/s²] that explains most."""
    left = np.ones_like(torques.weight)
    scale = 1 / (torques.weight * np.maximum(torques.size, _TINY))  # independent of the torques' units
    found = []
    for _ in range(_ROUNDS):
        gravity = torques.towards(scale, left)
        found.append(torques.explained(gravity * size / np.maximum(np.linalg.norm(gravity), _TINY)))
        scale, left = found[-1].scale, found[-1].left
    return min(found, key=lambda load: load.misfit)


def other_columns(velocity: Array, acceleration: Array) -> Array:
    """Regressor of viscous and Coulomb friction, offset and rotor inertia, (…, 4), at states (…)."""
    sign = np.tanh(velocity / SIGN_WIDTH)
    return np.stack([velocity, sign, np.ones_like(velocity), acceleration], -1)


def friction_basis(velocity: Array, acceleration: Array) -> Array:
    """Basis, (J, S, 4), of what each joint's friction, offset and rotor explain at states (S, J)."""
    columns = other_columns(velocity, acceleration).swapaxes(0, 1)
    return np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), _TINY)).Q


def unexplained(basis: Array, torques: Array) -> Array:
    """Torques (J or 1, S, K) without what a basis explains, (J, S, K)."""
    return torques - basis @ (basis.mT @ torques)


def share_left(described: Array, measured: Array) -> Array:
    """Share of torques (J, S, K) that described ones, (J, S, 1), leave when scaled to fit, (J, K)."""
    size = np.linalg.norm(described, axis=1) * np.linalg.norm(measured, axis=1)
    cosine = (described.mT @ measured)[:, 0] / np.maximum(size, _TINY)
    return np.maximum(1 - np.square(cosine), _TINY)


def misfit(body: RigidBody, motion: Sequence[Array], torque: Array) -> float:
    """Sum over joints of the logarithm of the unexplained share of torques in a motion, (S, J) each."""
    return misfit_by_order(body, *motion, torque)([*range(body.joints)])


def misfit_by_order(body: RigidBody, *signals: Array) -> Callable[[list[int]], float]:
    """Misfit of positions, velocities, accelerations and torques, (S, J), by the order of their columns."""
    *motion, torque = signals
    basis = friction_basis(*motion[1:])  # of columns: their order does not change it
    measured = unexplained(basis, torque.T[..., None])

    def misfit(order: list[int]) -> float:
        model = body.torque(*(x[:, order] for x in motion))
        described = unexplained(basis[order], model.T[..., None])
        return float(np.log(share_left(described, measured[order])).sum())

    return misfit
