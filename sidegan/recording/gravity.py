"""Direction of gravity and scales of torque in a recording, from the description's inertias."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy  # submodules load lazily

from sidegan.base.arrays import Array, geometric_mean
from sidegan.motion.dynamics import RigidBody
from sidegan.recording import thresholds
from sidegan.recording.misfit import friction_basis, halves_of, unexplained
from sidegan.recording.thresholds import NEGLIGIBLE, ROUNDING

_ROUNDS = 10  # of fitting scales and gravity alternately
_FIRST, _LAST = 0.05, 1e-3  # [rad] steps of the search for a tilt
_LEAST_NOISE = 1e-2  # of a joint's torque assumed to be noise at least


class GravityFit(NamedTuple):
    """The gravity with which a description explains torques best, and the scales of the torques."""

    gravity: Array  # in the world [m/s²], (3,); the described one unless another is far better
    # measured over described torque of each joint, (J,), both without what friction and rotors can explain
    scale: Array
    correlation: Array  # of the same torques, −1 to 1, (J,); 0 where the described torque is zero
    left: Array  # unexplained share of each joint's variance, (J,)

    @property
    def misfit(self) -> float:
        """Geometric mean of the unexplained shares: all joints count equally, whatever their noise."""
        return geometric_mean(np.maximum(self.left, NEGLIGIBLE))


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
        self.weight = 1 / np.maximum(np.linalg.norm(self.measured, axis=0), NEGLIGIBLE)

    def explained(self, gravity: Array) -> GravityFit:
        """Joint scales with a gravity [m/s²], (3,)."""
        model = self.inertial + self.static @ gravity
        products, squares = (model * self.measured).sum(0), np.square(model).sum(0)
        seen = np.sqrt(squares) > ROUNDING * np.maximum(self.size, NEGLIGIBLE)
        scale = np.where(seen, products / np.maximum(squares, NEGLIGIBLE**2), 0.0)
        cosine = np.where(seen, products / np.maximum(np.sqrt(squares), NEGLIGIBLE) * self.weight, 0.0)
        return GravityFit(gravity, scale, cosine, np.maximum(1 - np.square(cosine), 0.0))

    def towards(self, scale: Array, left: Array) -> Array:
        """Best gravity [m/s²], (3,), at these scales and unexplained shares, (J,) each."""
        weight = self.weight / np.maximum(np.sqrt(left), _LEAST_NOISE)
        rows = (self.static * (scale * weight)[:, None]).reshape(-1, 3)
        rest = ((self.measured - scale * self.inertial) * weight).ravel()
        return np.linalg.lstsq(rows, rest)[0]


def fit_gravity(body: RigidBody, q: Array, v: Array, a: Array, measured: Array) -> GravityFit:
    """Gravity and scales of measured torques (S, J) at states (S, J), from an arm's description.

    Larger masses cannot be told from larger gravity, so its magnitude is the description's, or zero.
    Another gravity is believed only if both halves of the samples agree on it.
    """
    states = q, v, a, measured
    torques = _Torques(body, *states)
    described = body.arm.gravity
    best = _best(torques, described)
    if best is not None:
        found = [_best(_Torques(body, *half), described) for half in halves_of(states)]
        if all(half is not None and _same_direction(half.gravity, best.gravity) for half in found):
            return best
    return torques.explained(described)


def tilt_of(described: Array, misfit: Callable[[Array, slice], float], samples: int) -> Array | None:
    """Gravity [m/s²], (3,), of a tilted base that explains torques far better than the described one.

    Its magnitude is the described one's, which masses make up for. None if there is no such gravity in both
    halves of the samples. ``misfit`` is the logarithm of the squared residuals with a gravity, in a part of
    the samples, mean over joints; a model may be fitted anew for it.
    """
    size = float(np.linalg.norm(described))
    if not size > 0:
        return None
    across = np.linalg.svd(described[None])[2][1:]  # two directions at right angles to it, (2, 3)

    def turned(tilt: Array) -> Array:
        direction = described / size + tilt @ across
        return size * direction / np.linalg.norm(direction)

    simplex = _FIRST * np.array([[0, 0], [1, 0], [0, 1]])
    tilt = scipy.optimize.minimize(
        lambda tilt: misfit(turned(tilt), slice(None)),
        np.zeros(2),
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": _LAST, "fatol": 0.1},
    ).x
    gravity = turned(tilt)
    least = np.log(thresholds.EXPLAINED_BY_GRAVITY)
    for half in (slice(None, samples // 2), slice(samples // 2, None)):
        if misfit(gravity, half) >= misfit(described, half) + least:
            return None
    return gravity if np.linalg.norm(tilt) > thresholds.NOTABLE_TILT else None


def _best(torques: _Torques, described: Array) -> GravityFit | None:
    """Fit with a gravity that explains torques far better than the described one [m/s²]; None if no such."""
    size = float(np.linalg.norm(described))
    if not size > 0:
        return None
    as_described = torques.explained(described)
    found = _other_direction(torques, size)
    others = [torques.explained(np.zeros_like(described))]
    others += [] if _same_direction(found.gravity, described) else [found]
    best = min(others, key=lambda fit: fit.misfit)
    better = best.misfit < thresholds.EXPLAINED_BY_GRAVITY * as_described.misfit
    return best if better and np.median(best.left) < thresholds.LEFT_BY_GRAVITY else None


def _same_direction(a: Array, b: Array) -> bool:
    """Whether two gravities, (3,), have nearly the same direction, or are both zero."""
    sizes = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) > sizes * math.cos(thresholds.OTHER_DIRECTION) if sizes > 0 else np.array_equal(a, b)


def _other_direction(torques: _Torques, size: float) -> GravityFit:
    """Fit with the gravity of this magnitude [m/s²] that explains most."""
    left = np.ones_like(torques.weight)
    scale = 1 / (torques.weight * np.maximum(torques.size, NEGLIGIBLE))  # independent of the torques' units
    found = []
    for _ in range(_ROUNDS):
        gravity = torques.towards(scale, left)
        found.append(torques.explained(gravity * size / np.maximum(np.linalg.norm(gravity), NEGLIGIBLE)))
        scale, left = found[-1].scale, found[-1].left
    return min(found, key=lambda fit: fit.misfit)
