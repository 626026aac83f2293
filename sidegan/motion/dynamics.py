"""Rigid-body dynamics of batches of states: regressor, torque, base parameters and Gram matrix.

Computed by compiled kernels, which are imported on first use.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array, numbers, split
from sidegan.base.threads import each, on_threads, threads
from sidegan.errors import RobotError, ShapeError
from sidegan.kernels.chain import Chain
from sidegan.motion.arrays import array, chain_of
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

LINK_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_STATES_EACH = 60  # random states per joint
_MOST_STATES = 720  # in total: 72 rows per column, while computation grows with the cube of the joints
# Norm, relative to the largest, below which a column counts as zero or as dependent on those before it.
# Rounding noise is near 1e-15, the weakest true effect near 1e-3. A right angle written as 1.5708 tilts a
# vertical joint by 4e-6, so that it feels the weight of everything it turns.
_NO_EFFECT = 1e-5
_FASTEST = 5.0  # largest acceleration of the random states [rad/s² or m/s²]
_ROUNDING = 1e-10  # smaller coefficients of the mapping are rounding
_STATES_IN_CACHE = 2_000  # per thread, whose regressor fits into the cache
_WORTH_A_THREAD = 1_000  # states, half a millisecond of work
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
        y = RigidBody(arm).regressor(q, draw[1] * arm.velocity_limit, draw[2] * _FASTEST)
        y = y.reshape(-1, y.shape[-1])
        norms = np.linalg.norm(y, axis=0)
        if not norms.max() > 0:
            raise RobotError(f"no inertial parameter of {arm.name} has an effect on its joint torques")
        columns = _first_independent(y / norms.max())
        scale = norms[columns]
        mapping = np.linalg.lstsq(y[:, columns] / scale, y, rcond=None)[0] / scale[:, None]
        mapping[np.abs(mapping) < _ROUNDING] = 0.0
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
        """Full regressor, (…, J, 10 J), with ``torque = regressor @ parameters`` [N·m or N]."""
        return self._rows(np.arange(10 * self.joints), q, dq, ddq)

    def base_regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Base regressor, (…, J, p), with ``torque = base_regressor @ base.values`` [N·m or N]."""
        return self._rows(self.base.columns, q, dq, ddq)

    def _rows(self, columns: Array, *states: Array) -> Array:
        """Ascending columns (K,) of the full regressor, (…, J, K).

        A view of an array with the states last, for fast products over samples.
        """
        from sidegan.kernels import dynamics, regressor

        checked = self.checked(*states)
        motion = _packed([x.reshape(1, -1, self.joints) for x in checked])
        count, of_links = motion.shape[-1], regressor.columns_of_links(columns, self.joints)
        y = np.zeros((len(columns), self.joints * (count + dynamics.LANES)))
        buffers = dynamics.dynamics_buffers(self.chain)
        span = regressor.base_rows(self.chain, motion, (0, 0, count), of_links, buffers, y)
        whole = y[:, : self.joints * span].reshape(len(columns), self.joints, span)
        return whole[:, :, :count].transpose(2, 1, 0).reshape(*checked[0].shape, len(columns))

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Inverse dynamics [N·m or N], (…, J), by the recursive Newton-Euler algorithm."""
        from sidegan.kernels import dynamics

        states = self.checked(q, dq, ddq)
        motion = _packed([x.reshape(1, -1, self.joints) for x in states])
        torque, parameters = np.empty(motion.shape[2:]), array(self.arm.inertial_parameters.ravel())
        buffers = dynamics.dynamics_buffers(self.chain)
        dynamics.inverse_dynamics(self.chain, motion, parameters, torque, buffers)
        return torque.T.reshape(states[0].shape)

    def drive_torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Torque of the drives [N·m or N], (…, J): ``torque`` plus known friction and rotor inertia."""
        q, dq, ddq = self.checked(q, dq, ddq)
        return self.torque(q, dq, ddq) + self.arm.known_drives.torque(dq, ddq)

    def sums(self, q: Array, dq: Array, ddq: Array, torque: Array) -> Array:
        """Each joint's sums of products of base columns and torque, (J, p + 1, p + 1), over S samples.

        States and torque are (S, J). The regressor is never stored.
        """
        from sidegan.kernels import dynamics, regressor

        states, torque = self.checked(q, dq, ddq), numbers(torque, "torque")
        if not states[0].shape == torque.shape == (len(torque), self.joints):
            raise ShapeError(
                f"states are {states[0].shape}, torque is {torque.shape}, expected (S, {self.joints}) both"
            )
        count, size = threads_for(len(torque), len(torque)), self.parameters_count + 1
        of_links = regressor.columns_of_links(self.base.columns, self.joints)
        products = np.zeros((count, self.joints, size, size))
        parts = [np.array_split(x, count) for x in (*states, torque)]

        def work(k: int) -> None:
            *piece, own = (x[k] for x in parts)
            y = dynamics.aligned(size, self.joints * regressor.SPAN)
            buffers = dynamics.dynamics_buffers(self.chain)
            motion = _packed([x[None] for x in piece])
            regressor.base_products(self.chain, motion, array(own.T), of_links, products[k], buffers, y)

        each(work, count)
        return products.sum(0)

    def grams(self, q: Array, dq: Array, ddq: Array, certainty: Array | None = None) -> Array:
        """Gram matrices YᵀY / T of the base regressor, summed over joints, (B, p, p), of states (B, T, J).

        Each joint's rows of Y are weighted by its certainty, (J,); None: ones.
        """
        from sidegan.kernels import dynamics, information, regressor

        states = self.checked(q, dq, ddq)
        if states[0].ndim != 3:
            raise ShapeError(f"position is {states[0].shape}, expected (B, T, {self.joints})")
        (batch, count, joints), size = states[0].shape, self.parameters_count
        of_links = regressor.columns_of_links(self.base.columns, joints)
        rigid = information.no_terms(joints)
        if certainty is not None:
            if certainty.shape != (joints,):
                raise ShapeError(f"certainty is {certainty.shape}, expected ({joints},)")
            rigid = rigid._replace(roots=array(certainty))
        grams = np.empty((batch, size, size))

        def work(k: slice) -> None:
            y = dynamics.aligned(size, joints * regressor.SPAN)
            buffers, motion = dynamics.dynamics_buffers(self.chain), _packed([x[k] for x in states])
            extra = rigid, information.signals_for(rigid, count, 0)
            information.weighted_grams(self.chain, motion, of_links, extra, grams[k], buffers, y)

        share(work, batch, count)
        return grams

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
    """Gram matrices of trajectories, (B, p, p), as of ``RigidBody.grams``, from samples spread over a period.

    Takes about 150 MB in addition to the result, whatever the number of trajectories, samples and joints.
    """
    times = trajectory.grid(samples)
    batch = max(1, _STATES_IN_CACHE * threads() // samples)
    motions = (trajectory.roll_out(part, times)[1:] for part in split(c, batch))
    return np.concatenate([body.grams(*states, certainty) for states in motions])


def _packed(states: Sequence[Array]) -> Array:
    """States (B, T, J) for kernels, (5, B, J, T): sine and cosine of the position, then the states."""
    from sidegan.kernels.links import waves

    batch, count, joints = states[0].shape
    packed = np.empty((5, batch, joints, count))
    for row, x in zip(packed[2:], states):
        row[...] = x.transpose(0, 2, 1)
    waves(packed[2].ravel(), packed[0].ravel(), packed[1].ravel())
    return packed


def threads_for(tasks: int, states: int) -> int:
    """Number of threads worth using for this many tasks and states."""
    return max(1, min(threads(), tasks, states // _WORTH_A_THREAD))


def share(work: Callable[[slice], None], batch: int, states: int) -> None:
    """Run work on slices of a batch, one per thread; each item is as much work as ``states`` states."""
    count = threads_for(batch, batch * states)
    cuts = [batch * k // count for k in range(count + 1)]
    each(lambda k: work(slice(cuts[k], cuts[k + 1])), count)


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
