"""Rigid-body dynamics of batches of states: regressor, torque, base parameters and Gram matrix.

On processors and in float64, compiled kernels do the work where they can be had (``backend``); elsewhere,
and for what has no kernel, plain torch does.
"""

from collections.abc import Sequence
from functools import cached_property

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion import newton_euler, plain
from sidegan.motion.backend import backend
from sidegan.motion.base_parameters import LINK_PARAMETERS, BaseParameters
from sidegan.motion.compiled.chain import Chain
from sidegan.motion.compiled.limits import Limits, Near
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

__all__ = ["LINK_PARAMETERS", "BaseParameters", "RigidBody", "gram", "gram_of"]


class RigidBody:
    """Dynamics of a serial arm; tensors follow the device and dtype of the states given.

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
        """Number of base parameters p, derived from the robot."""
        return len(self.base.values)

    @cached_property
    def base(self) -> BaseParameters:
        """Base parameters of the arm, from the regressor over random states."""
        return BaseParameters.of(self.arm)

    @cached_property
    def chain(self) -> Chain:
        """The arm as compiled kernels take it."""
        return Chain.of(self.arm)

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Full regressor, (…, J, 10 J), with ``torque = regressor @ parameters`` [N·m]."""
        self._check(q, dq, ddq)
        return plain.regressor(self, (q, dq, ddq))

    def base_regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Base regressor, (…, J, p), with ``torque = base_regressor @ base.values`` [N·m]."""
        return self.regressor(q, dq, ddq)[..., self.base.columns.to(q.device)]

    def torque(self, q: Tensor, dq: Tensor, ddq: Tensor, parameters: Tensor | None = None) -> Tensor:
        """Inverse dynamics [N·m], (…, J), by the recursive Newton-Euler algorithm.

        The parameters are the arm's own when None, else (J, 10), (10 J,) or one set per state, (…, 10 J).
        """
        self._check(q, dq, ddq)
        if parameters is None:
            parameters = self.arm.inertial_parameters
        full = 10 * self.joints
        if parameters.shape not in ((self.joints, 10), (full,), (*q.shape[:-1], full)):
            raise ShapeError(
                f"parameters are {tuple(parameters.shape)}, expected ({self.joints}, 10), ({full},) or "
                f"{(*q.shape[:-1], full)}"
            )
        v = parameters.to(q.device, q.dtype)
        if v.ndim <= 2 and v.numel() == full and q.ndim > 1:  # one set for all states
            flat = [x.reshape(1, -1, self.joints) for x in (q, dq, ddq)]
            return self.torques_of(flat[0], flat[1], flat[2], v.reshape(1, 1, full)).reshape(q.shape)
        v = v.reshape(-1, full).T.reshape(self.joints, 10, 1, -1)
        states = newton_euler.states_last((q, dq, ddq))
        return newton_euler.torque(self.chain, states, v)[:, 0].T.reshape(q.shape)

    def torque_rate(self, q: Tensor, dq: Tensor, ddq: Tensor, jerk: Tensor) -> Tensor:
        """Rate of the arm's torques [N·m/s], (…, J), of positions and their derivatives (…, J)."""
        states = newton_euler.states_last((q, dq, ddq, jerk))
        parameters = self.arm.inertial_parameters.to(q.device, q.dtype)
        return newton_euler.torque_rates(self.chain, states, parameters).T.reshape(q.shape)

    def torques_of(self, q: Tensor, dq: Tensor, ddq: Tensor, parameters: Tensor) -> Tensor:
        """Regressor times several parameter sets, (B, K, T, J), of states (B, T, J) and sets (B, K, 10 J).

        This is Y v for the K vectors v of each trajectory, at the cost of inverse dynamics.
        """
        self._check(q, dq, ddq)
        return backend(q, dq, ddq, parameters).torques(self, (q, dq, ddq), parameters)

    def sums(self, q: Tensor, dq: Tensor, ddq: Tensor, torque: Tensor) -> Tensor:
        """Each joint's sums of products of base columns and torque, (J, p + 1, p + 1), over S samples.

        States and torque are (S, J). Not differentiable; no regressor is kept.
        """
        self._check(q, dq, ddq)
        return backend(q, dq, ddq, torque).sums(self, (q, dq, ddq), torque)

    def penalised_slopes(
        self,
        states: Sequence[Tensor],
        parameters: Tensor,
        weights: Tensor,
        limits: Limits | None = None,
        near: Near | None = None,
    ) -> tuple[Tensor, list[Tensor]]:
        """Penalty summed over time, (B,), and gradients, (B, T, J) each, of it and of Σ weight · |Y v|².

        The vectors v are (B, K, 10 J), their weights (B, K); no limits and no distances cost nothing.
        """
        self._check(*states)
        who, limits = backend(*states, parameters, weights), limits or Limits.none(self.joints)
        return who.penalised_slopes(self, states, parameters, weights, limits, near)

    def _check(self, q: Tensor, dq: Tensor, ddq: Tensor) -> None:
        for name, x in (("position", q), ("velocity", dq), ("acceleration", ddq)):
            if x.shape != q.shape or x.shape[-1:] != (self.joints,):
                raise ShapeError(f"{name} is {tuple(x.shape)}, expected (…, {self.joints}), all three alike")


def gram(body: RigidBody, trajectory: Trajectory, c: Tensor, samples: int = 80) -> Tensor:
    """Gram matrices YᵀY / T of the base regressor, summed over joints, (B, p, p), at centres of cells.

    Without gradients it works in about 150 MB beside its result, whatever the number of
    trajectories, samples and joints: the regressor exists for a few thousand states at a time.
    """
    times = trajectory.grid(samples)
    batch = max(1, backend(c).states_at_once(body.joints) // samples)
    return torch.cat([gram_of(body, *trajectory.roll_out(part, times)[1:]) for part in c.split(batch)])


def gram_of(body: RigidBody, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
    """Gram matrices YᵀY / T of the base regressor, (B, p, p), at states (B, T, J)."""
    body._check(q, dq, ddq)
    return backend(q, dq, ddq).gram(body, body.base.columns, (q, dq, ddq))
