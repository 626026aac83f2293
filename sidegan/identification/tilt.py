"""Direction of gravity that explains torques best, when links and friction are identified anew with it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy  # submodules load lazily

from sidegan.base.arrays import Array
from sidegan.identification.fit import reweighted
from sidegan.identification.measurements import Measurements, thinned
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import sums_of
from sidegan.motion.dynamics import RigidBody

_SAMPLES = 1_000  # enough to find a tilt
_FIRST = 0.05  # [rad] of the search
_FINE = 1e-3  # [rad] at which it ends
_NOTABLE = 0.03  # [rad] smallest tilt that is reported
_EXPLAINED = 0.7  # most of the squared residuals that may remain, in either half of the samples
_TINY = np.finfo(float).tiny


def tilted_gravity(model: TorqueModel, samples: Sequence[Measurements]) -> Array | None:
    """Gravity [m/s²] in the base frame, (3,), that explains torques far better; None if none does.

    Of the description's magnitude, which masses make up for.
    """
    described = model.arm.gravity
    size = float(np.linalg.norm(described))
    if not size > 0:
        return None
    across = np.linalg.svd(described[None])[2][1:]  # two directions at right angles to it, (2, 3)
    whole = thinned(samples, _SAMPLES)
    q, resting = whole.position, 0 * whole.position
    inertial, *static = (RigidBody(replace(model.arm, gravity=g)) for g in np.eye(4, 3, -1))
    moved = inertial.regressor(*whole.states)
    held = np.stack([body.regressor(q, resting, resting) for body in static])  # by 1 m/s² along each axis
    terms = model.regressor(*whole.inputs)[..., model.rigid :]

    def turned(tilt: Array) -> Array:
        direction = described / size + tilt @ across
        return size * direction / np.linalg.norm(direction)

    def left(gravity: Array, part: slice) -> float:
        """Logarithm of the squared residuals, mean over joints."""
        links = moved[part] + np.tensordot(gravity, held[:, part], 1)
        sums = sums_of(np.concatenate([links, terms[part]], 2), whole.torque[part])
        return float(np.log(np.maximum(sums.squares(reweighted(sums).parameters), _TINY)).mean())

    found = scipy.optimize.minimize(
        lambda tilt: left(turned(tilt), slice(None)),
        np.zeros(2),
        method="Nelder-Mead",
        options={
            "initial_simplex": _FIRST * np.array([[0, 0], [1, 0], [0, 1]]),
            "xatol": _FINE,
            "fatol": 0.1,
        },
    ).x
    halves = slice(None, len(whole) // 2), slice(len(whole) // 2, None)
    better = (left(turned(found), x) < left(described, x) + np.log(_EXPLAINED) for x in halves)
    return turned(found) if np.linalg.norm(found) > _NOTABLE and all(better) else None
