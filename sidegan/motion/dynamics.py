"""Rigid-body dynamics of batches of states: regressor, torque, base parameters and Gram matrix.

Computed by compiled kernels, which are imported on first use.
"""

from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array, numbers, split
from sidegan.base.threads import threads
from sidegan.errors import ShapeError
from sidegan.kernels.chain import Chain
from sidegan.motion.arrays import chain_of
from sidegan.motion.base_parameters import LINK_PARAMETERS, BaseParameters
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

__all__ = ["LINK_PARAMETERS", "BaseParameters", "RigidBody", "gram"]

_STATES_IN_CACHE = 2_000  # per thread, whose regressor fits into the cache

_found: WeakKeyDictionary[Arm, BaseParameters] = WeakKeyDictionary()


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
        if self.arm not in _found:
            _found[self.arm] = BaseParameters.of(self.arm)
        return _found[self.arm]

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

        q, *_ = checked = self._checked(*states)
        flat = [x.reshape(-1, self.joints) for x in checked]
        return operations.rows(self.chain, columns, flat).reshape(*q.shape, len(columns))

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Inverse dynamics [N·m], (…, J), by the recursive Newton-Euler algorithm."""
        from sidegan.motion import operations

        q, *_ = checked = self._checked(q, dq, ddq)
        flat = [x.reshape(-1, self.joints) for x in checked]
        return operations.torques(self.chain, flat, self.arm.inertial_parameters).reshape(q.shape)

    def drive_torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Torque of the drives [N·m], (…, J): ``torque`` plus known friction and rotor inertia."""
        q, dq, ddq = self._checked(q, dq, ddq)
        return self.torque(q, dq, ddq) + self.arm.known_drives.torque(dq, ddq)

    def sums(self, q: Array, dq: Array, ddq: Array, torque: Array) -> Array:
        """Each joint's sums of products of base columns and torque, (J, p + 1, p + 1), over S samples.

        States and torque are (S, J). The regressor is never stored.
        """
        from sidegan.motion import operations

        states = self._checked(q, dq, ddq)
        return operations.sums(self.chain, self.base.columns, states, torque)

    def _checked(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> list[Array]:
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
        states = body._checked(*trajectory.roll_out(part, times)[1:])
        grams.append(operations.gram(body.chain, body.base.columns, states, certainty))
    return np.concatenate(grams)
