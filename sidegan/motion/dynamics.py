"""Rigid-body dynamics of batches of states: regressor, torque, base parameters and Gram matrix.

Compiled kernels, imported when they are used, do the work, in float64 on the processor, whatever the states'
type and device.
"""

from functools import cached_property
from weakref import WeakKeyDictionary

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.kernels.chain import Chain
from sidegan.motion.arrays import chain_of
from sidegan.motion.base_parameters import LINK_PARAMETERS, BaseParameters
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

__all__ = ["LINK_PARAMETERS", "BaseParameters", "RigidBody", "gram", "gram_of"]

_STATES_IN_CACHE = 2_000  # per thread: their regressor stays near the processor

_found: WeakKeyDictionary[Arm, BaseParameters] = WeakKeyDictionary()


class RigidBody:
    """Dynamics of a serial arm.

    States are joint position [rad or m], velocity and acceleration, (…, J) each. Nothing is differentiable.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.arm.joints

    @property
    def parameters_count(self) -> int:
        """Number of base parameters p, derived from the robot."""
        return len(self.base.values)

    @cached_property
    def base(self) -> BaseParameters:
        """Base parameters of the arm, from the regressor over random states; found once for each arm."""
        if self.arm not in _found:
            _found[self.arm] = BaseParameters.of(self.arm)
        return _found[self.arm]

    @cached_property
    def chain(self) -> Chain:
        """The arm as compiled kernels take it."""
        return chain_of(self.arm)

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Full regressor, (…, J, 10 J), with ``torque = regressor @ parameters`` [N·m]."""
        return self._rows(torch.arange(10 * self.joints), q, dq, ddq)

    def base_regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Base regressor, (…, J, p), with ``torque = base_regressor @ base.values`` [N·m]."""
        return self._rows(self.base.columns, q, dq, ddq)

    def _rows(self, columns: Tensor, *states: Tensor) -> Tensor:
        from sidegan.motion import operations

        flat = [x.reshape(-1, self.joints) for x in self._checked(*states)]
        return operations.rows(self.chain, columns, flat).reshape(*states[0].shape, len(columns))

    def torque(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Inverse dynamics [N·m], (…, J), by the recursive Newton-Euler algorithm."""
        from sidegan.motion import operations

        flat = [x.reshape(-1, self.joints) for x in self._checked(q, dq, ddq)]
        return operations.torques(self.chain, flat, self.arm.inertial_parameters).reshape(q.shape)

    def drive_torque(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Torque of the drives [N·m], (…, J): ``torque``, and what is known of their friction and rotors."""
        return self.torque(q, dq, ddq) + self.arm.known_drives.torque(dq, ddq)

    def sums(self, q: Tensor, dq: Tensor, ddq: Tensor, torque: Tensor) -> Tensor:
        """Each joint's sums of products of base columns and torque, (J, p + 1, p + 1), over S samples.

        States and torque are (S, J). No regressor is kept.
        """
        from sidegan.motion import operations

        states = self._checked(q, dq, ddq)
        return operations.sums(self.chain, self.base.columns, states, torque.to("cpu", torch.float64))

    def _checked(self, q: Tensor, dq: Tensor, ddq: Tensor) -> list[Tensor]:
        """The states as kernels take them."""
        for name, x in (("position", q), ("velocity", dq), ("acceleration", ddq)):
            if x.shape != q.shape or x.shape[-1:] != (self.joints,):
                raise ShapeError(f"{name} is {tuple(x.shape)}, expected (…, {self.joints}), all three alike")
        return [x.to("cpu", torch.float64) for x in (q, dq, ddq)]


def gram(body: RigidBody, trajectory: Trajectory, c: Tensor, samples: int = 80) -> Tensor:
    """Gram matrices YᵀY / T of the base regressor, summed over joints, (B, p, p), at centres of cells.

    It works in about 150 MB beside its result, whatever the number of trajectories, samples and joints.
    """
    times, c = trajectory.grid(samples), c.to("cpu", torch.float64)
    batch = max(1, _STATES_IN_CACHE * torch.get_num_threads() // samples)
    return torch.cat([gram_of(body, *trajectory.roll_out(part, times)[1:]) for part in c.split(batch)])


def gram_of(body: RigidBody, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
    """Gram matrices YᵀY / T of the base regressor, (B, p, p), at states (B, T, J)."""
    from sidegan.motion import operations

    return operations.gram(body.chain, body.base.columns, body._checked(q, dq, ddq))
