"""Base parameters: the identifiable combinations of an arm's inertial parameters."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.threads import on_threads
from sidegan.errors import RobotError
from sidegan.motion.arrays import chain_of
from sidegan.robot import Arm

LINK_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_STATES_EACH = 60  # random states per joint
_MOST_STATES = 720  # in total: 72 rows per column, while computation grows with the cube of the joints
# Norm, relative to the largest, below which a column counts as zero or as dependent on those before it.
# Rounding noise is near 1e-15, the weakest true effect near 1e-3. A right angle written as 1.5708 tilts a
# vertical joint by 4e-6, so that it feels the weight of everything it turns.
_NO_EFFECT = 1e-5


@dataclass(frozen=True)
class BaseParameters:
    """Identifiable combinations of the inertial parameters (Gautier 1991)."""

    columns: Array  # indices of the independent columns of the full regressor, ascending, (p,)
    mapping: Array  # base parameters from full ones, (p, 10 J); the full regressor is ``base @ mapping``
    values: Array  # base parameters of the arm, (p,)
    subspace: Array  # C with C Cᵀ = mapping mappingᵀ, (p, p): Cᵀ G C has the spectrum of the full YᵀY
    names: tuple[str, ...]  # the leading parameter of each combination, such as ``"Ixx2"``

    @classmethod
    @on_threads(1)
    def of(cls, arm: Arm) -> "BaseParameters":
        """Base parameters from the regressor of 60 random states per joint, at most 720.

        The columns are the first linearly independent ones in Pinocchio's order. Rounding noise does not
        count, nor do effects that come only from rounded angles in the description. This runs on one thread,
        so that all processes find the same numbers.

        Raises:
            RobotError: when no parameter has any effect on the torques.
        """
        y = _random_rows(arm)
        norms = np.linalg.norm(y, axis=0)
        if not norms.max() > 0:
            raise RobotError(f"no inertial parameter of {arm.name} has an effect on its joint torques")
        columns = _first_independent(y / norms.max())
        scale = norms[columns]
        mapping = np.linalg.lstsq(y[:, columns] / scale, y, rcond=None)[0] / scale[:, None]
        mapping[np.abs(mapping) < 1e-10] = 0.0
        mapping[:, columns] = np.eye(len(columns))
        values = mapping @ arm.inertial_parameters.ravel()
        subspace = np.linalg.cholesky(mapping @ mapping.T)
        names = tuple(f"{LINK_PARAMETERS[c % 10]}{c // 10 + 1}" for c in columns)
        return cls(columns, mapping, values, subspace, names)


def _random_rows(arm: Arm) -> Array:
    """Rows of the full regressor over S random states, (S J, 10 J)."""
    from sidegan.motion import operations

    random = np.random.default_rng(0)
    states = min(_STATES_EACH * arm.joints, _MOST_STATES)
    draw = random.random((3, states, arm.joints)) * 2 - 1
    span = (arm.position_upper - arm.position_lower) / 2
    q = (arm.position_upper + arm.position_lower) / 2 + span * draw[0]
    full = np.arange(10 * arm.joints)
    y = operations.rows(chain_of(arm), full, (q, draw[1] * arm.velocity_limit, draw[2] * 5.0))
    return y.reshape(-1, len(full))


def _first_independent(y: Array) -> Array:
    """Indices of the first linearly independent columns, whose norms are at most 1, from left to right."""
    triangle: Array = np.asarray(np.linalg.qr(y, mode="r"))
    basis = np.zeros((0, len(triangle)))
    kept = list[int]()
    for k, column in enumerate(triangle.T):
        rest = column
        for _ in range(2):  # Gram-Schmidt, twice
            rest = rest - basis.T @ (basis @ rest)
        if (size := float(np.linalg.norm(rest))) > _NO_EFFECT:
            kept.append(k)
            basis = np.vstack([basis, rest / size])
    return np.array(kept)
