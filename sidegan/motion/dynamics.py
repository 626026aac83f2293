"""Rigid-body dynamics of batches of states: regressor, torque, base parameters and Gram matrix.

Computed by compiled kernels, which are imported on first use.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array, numbers, split
from sidegan.base.threads import on_threads, threads
from sidegan.errors import RobotError, ShapeError
from sidegan.kernels.chain import Chain
from sidegan.motion.arrays import chain_of
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

LINK_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_STATES_EACH = 60  # random states per joint
_MOST_STATES = 720  # in total: 72 rows per column, while computation grows with the cube of the joints
# Norm, relative to the largest, below which a column counts as zero or as dependent on those before it.
# Rounding noise is near 1e-15, the weakest true effect near 1e-3. A right angle written as 1.5708 tilts a
# vertical joint by 4e-6, so that it feels the weight of everything it turns.
_NO_EFFECT = 1e-5
_STATES_IN_CACHE = 2_000  # per thread, whose regressor fits into the cache
_ARMS = 64  # whose base parameters are kept


@dataclass(frozen=True)
class BaseParameters:
    """Identifiable combinations of the inertial parameters (Gautier 1991)."""

    columns: Array  # indices of the independent columns of the full regressor, ascending, (p,)
    mapping: Array  # base parameters from full ones, (p, 10 J); the full regressor is ``base @ mapping``
    values: Array  # base parameters of the arm, (p,)
    subspace: Array  # C with C Cᵀ = mapping mappingᵀ, (p, p): Cᵀ G C has the spectrum of the full YᵀY
    names: tuple[str, ...]  # the leading parameter of each combination, such as ``"Ixx2"``

    @classmethod
    @lru_cache(_ARMS)
    @on_threads(1)
    def of(cls, arm: Arm) -> "BaseParameters":
        """Base parameters from the regressor of 60 random states per joint, at most 720.

        The columns are the first linearly independent ones in Pinocchio's order. Rounding noise does not
        count, nor do effects that come only from rounded angles in the description. This runs on one thread,
        so that all processes find the same numbers.

        Raises:
            RobotError: when no parameter has any effect on the torques.
        """
        states = min(_STATES_EACH * arm.joints, _MOST_STATES)
        draw = np.random.default_rng(0).random((3, states, arm.joints)) * 2 - 1
        lower, upper = arm.position_lower, arm.position_upper
        q = (upper + lower) / 2 + (upper - lower) / 2 * draw[0]
        y = RigidBody(arm).regressor(q, draw[1] * arm.velocity_limit, draw[2] * 5.0)
        y = y.reshape(-1, y.shape[-1])
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


class RigidBody:
    """Dynamics of a serial arm.

    States are joint position [rad or m], velocity and acceleration, (…, J) each.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.arm.joints

    @property
    def parameters_count(self) -> int:
        """Number of base parameters p."""
        return len(self.base.values)

    @cached_property
    def base(self) -> BaseParameters:
        """Base parameters of the arm, computed once for each arm."""
        return BaseParameters.of(self.arm)

    @cached_property
    def chain(self) -> Chain:
        """The arm's kinematic chain for compiled kernels."""
        return chain_of(self.arm)

    def regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Full regressor, (…, J, 10 J), with ``torque = regressor @ parameters`` [N·m]."""
        return self._rows(np.arange(10 * self.joints), q, dq, ddq)

    def base_regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Base regressor, (…, J, p), with ``torque = base_regressor @ base.values`` [N·m]."""
        return self._rows(self.base.columns, q, dq, ddq)

    def _rows(self, columns: Array, *states: Array) -> Array:
        from sidegan.motion import operations

        q, *_ = checked = self.checked(*states)
        flat = [x.reshape(-1, self.joints) for x in checked]
        return operations.rows(self.chain, columns, flat).reshape(*q.shape, len(columns))

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Inverse dynamics [N·m], (…, J), by the recursive Newton-Euler algorithm."""
        from sidegan.motion import operations

        states = self.checked(q, dq, ddq)
        flat = [x.reshape(-1, self.joints) for x in states]
        return operations.torques(self.chain, flat, self.arm.inertial_parameters).reshape(states[0].shape)

    def drive_torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Torque of the drives [N·m], (…, J): ``torque`` plus known friction and rotor inertia."""
        q, dq, ddq = self.checked(q, dq, ddq)
        return self.torque(q, dq, ddq) + self.arm.known_drives.torque(dq, ddq)

    def sums(self, q: Array, dq: Array, ddq: Array, torque: Array) -> Array:
        """Each joint's sums of products of base columns and torque, (J, p + 1, p + 1), over S samples.

        States and torque are (S, J). The regressor is never stored.
        """
        from sidegan.motion import operations

        states = self.checked(q, dq, ddq)
        return operations.joint_sums(self.chain, self.base.columns, states, torque)

    def checked(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> list[Array]:
        """States as float64 arrays, after a check of their shapes."""
        given = {"position": q, "velocity": dq, "acceleration": ddq}
        states = {name: numbers(x, name) for name, x in given.items()}
        for name, x in states.items():
            if x.shape != states["position"].shape or x.shape[-1:] != (self.joints,):
                raise ShapeError(f"{name} is {x.shape}, expected (…, {self.joints}), all three alike")
        return [*states.values()]


def gram(
    body: RigidBody, trajectory: Trajectory, c: Array, samples: int = 80, certainty: Array | None = None
) -> Array:
    """Gram matrices YᵀY / T of the base regressor, summed over joints, (B, p, p), at centres of cells.

    Each joint's rows of Y are weighted by its certainty, (J,); None: ones. Takes about 150 MB in addition to
    the result, whatever the number of trajectories, samples and joints.
    """
    from sidegan.motion import operations

    times = trajectory.grid(samples)
    batch = max(1, _STATES_IN_CACHE * threads() // samples)
    grams = []
    for part in split(c, batch):
        states = body.checked(*trajectory.roll_out(part, times)[1:])
        grams.append(operations.gram_matrices(body.chain, body.base.columns, states, certainty))
    return np.concatenate(grams)


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
