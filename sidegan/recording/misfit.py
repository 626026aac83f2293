"""What friction, rotors and a description leave unexplained of torques."""

from collections.abc import Callable, Sequence

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import SIGN_WIDTH
from sidegan.recording.thresholds import NEGLIGIBLE, ROUNDING


def subset(signals: Sequence[Array], most: int) -> list[Array]:
    """Every n-th sample of signals, (S, …) each, so that hardly more than ``most`` are left."""
    return [x[:: max(1, len(x) // most)] for x in signals]


def halves_of(signals: Sequence[Array]) -> tuple[list[Array], list[Array]]:
    """Signals in the first and in the second half of their samples."""
    parts = [np.array_split(x, 2) for x in signals]
    return [first for first, _ in parts], [second for _, second in parts]


def other_columns(velocity: Array, acceleration: Array) -> Array:
    """Regressor of viscous and Coulomb friction, offset and rotor inertia, (…, 4), at states (…)."""
    sign = np.tanh(velocity / SIGN_WIDTH)
    return np.stack([velocity, sign, np.ones_like(velocity), acceleration], -1)


def friction_basis(velocity: Array, acceleration: Array) -> Array:
    """Basis, (J, S, 4), of what each joint's friction, offset and rotor explain at states (S, J)."""
    columns = other_columns(velocity, acceleration).swapaxes(0, 1)
    return np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), NEGLIGIBLE)).Q


def unexplained(basis: Array, torques: Array) -> Array:
    """Torques (J or 1, S, K) without what a basis explains, (J, S, K)."""
    return torques - basis @ (basis.mT @ torques)


def told_by(basis: Array, described: Array) -> Array:
    """Described torques (S, J) without what a basis explains, (J, S, 1); zero if that is all but rounding."""
    rest = unexplained(basis, described.T[..., None])
    size = np.linalg.norm(described, axis=0)
    return rest * (np.linalg.norm(rest, axis=1) > ROUNDING * size[:, None])[:, None]


def share_left(described: Array, measured: Array) -> Array:
    """Share of torques (J, S, K) that described ones, (J, S, 1), leave when scaled to fit, (J, K)."""
    size = np.linalg.norm(described, axis=1) * np.linalg.norm(measured, axis=1)
    cosine = (described.mT @ measured)[:, 0] / np.maximum(size, NEGLIGIBLE)
    return np.maximum(1 - np.square(cosine), NEGLIGIBLE)


def misfit(body: RigidBody, *signals: Array) -> float:
    """Sum over joints of the logarithm of the unexplained share of torques; see ``misfit_by_order``."""
    return misfit_by_order(body, *signals)([*range(body.joints)])


def misfit_by_order(body: RigidBody, *signals: Array) -> Callable[[list[int]], float]:
    """Misfit of positions, velocities, accelerations and torques, (S, J), by the order of their columns."""
    *motion, torque = signals
    basis = friction_basis(*motion[1:])  # of columns: their order does not change it
    measured = unexplained(basis, torque.T[..., None])

    def misfit(order: list[int]) -> float:
        model = body.torque(*(x[:, order] for x in motion))
        described = told_by(basis[order], model)
        return float(np.log(share_left(described, measured[order])).sum())

    return misfit
