"""Rigid-body dynamics in torch: regressor, torque, base parameters and Gram matrix, batched.

Everything runs over N states at once with the states in the last, contiguous dimension: vectors are
(3, N) and joint-wise stacks (3, K, N). Link frames follow the arm's joint frames. On processors and in
float64, compiled kernels do the same work faster where they can be had (``sidegan.motion.compiled``).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import torch
from scipy.linalg import qr
from torch import Tensor

from sidegan.errors import RobotError, ShapeError
from sidegan.motion.compiled import tensors as kernels
from sidegan.motion.compiled.chain import Chain
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

LINK_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_VALUES_AT_ONCE = 4_000_000  # of the full regressor: 32 MB, and four times that in intermediate results
_STATES_IN_CACHE = 2_000  # of compiled kernels: their regressor stays near the processor
_RANK_TOLERANCE = 1e-9  # relative; rounding noise sits near 1e-15, the weakest true direction near 1e-3


@dataclass(frozen=True)
class BaseParameters:
    """The identifiable combinations of the inertial parameters (Gautier 1991).

    Attributes:
        columns: indices of the independent columns of the full regressor, (p,).
        mapping: base parameters from full ones, (p, 10 J); the full regressor is ``base @ mapping``.
        values: base parameters of the arm, (p,).
        subspace: C with C Cᵀ = mapping mappingᵀ, (p, p): Cᵀ G C has the spectrum of the full YᵀY.
        names: the leading parameter of each combination, such as ``"Ixx2"``.
    """

    columns: Tensor
    mapping: Tensor
    values: Tensor
    subspace: Tensor
    names: tuple[str, ...]


class RigidBody:
    """Dynamics of a serial arm; tensors follow the device and dtype of the states given."""

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
        return _base_parameters(self)

    @cached_property
    def chain(self) -> Chain:
        """The arm as compiled kernels take it."""
        return Chain.of(self.arm)

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Full regressor, (…, J, 10 J), with ``torque = regressor @ parameters`` [N·m].

        Args:
            q: joint position [rad or m], (…, J).
            dq: joint velocity, (…, J).
            ddq: joint acceleration, (…, J).

        Raises:
            ShapeError: when a shape does not fit the arm.

        Source: Atkeson, An, Hollerbach 1986; columns in Pinocchio's order.
        """
        states = self._states(q, dq, ddq)
        y = self._regressor(*states)
        return y.permute(2, 0, 1).reshape(*q.shape, 10 * self.joints)

    def base_regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Base regressor, (…, J, p), with ``torque = base_regressor @ base.values`` [N·m]."""
        return self.regressor(q, dq, ddq)[..., self.base.columns.to(q.device)]

    def torque(self, q: Tensor, dq: Tensor, ddq: Tensor, parameters: Tensor | None = None) -> Tensor:
        """Inverse dynamics [N·m], (…, J), by the recursive Newton-Euler algorithm.

        Args:
            q: joint position, (…, J).
            dq: joint velocity, (…, J).
            ddq: joint acceleration, (…, J).
            parameters: inertial parameters, (J, 10) or (10 J,) or one set per state, (…, 10 J);
                the arm's own when None.

        Raises:
            ShapeError: when a shape does not fit the arm.
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
            q_all, dq_all, ddq_all = (x.reshape(1, -1, self.joints) for x in (q, dq, ddq))
            return self.torques_of(q_all, dq_all, ddq_all, v.reshape(1, 1, full)).reshape(q.shape)
        v = v.reshape(-1, full).T.reshape(self.joints, 10, 1, -1)
        return self._torque(*self._states(q, dq, ddq), v)[:, 0].T.reshape(q.shape)

    def torques_of(self, q: Tensor, dq: Tensor, ddq: Tensor, parameters: Tensor) -> Tensor:
        """Regressor times several parameter sets, (B, K, T, J), of states (B, T, J) and sets (B, K, 10 J).

        This is Y v for the K vectors v of each trajectory, at the cost of inverse dynamics.
        """
        self._check(q, dq, ddq)

        def plain(q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
            return self._torques_of(q, dq, ddq, parameters)

        if not parameters.requires_grad and kernels.usable(q, dq, ddq, parameters):
            return kernels.torques(self.chain, (q, dq, ddq), parameters, plain)
        return plain(q, dq, ddq)

    def _torques_of(self, q: Tensor, dq: Tensor, ddq: Tensor, parameters: Tensor) -> Tensor:
        batch, count, joints = q.shape
        sets = parameters.shape[1]
        v = parameters.permute(2, 1, 0).reshape(joints, 10, sets, batch, 1)
        if batch > 1:
            v = v.expand(joints, 10, sets, batch, count)
        v = v.reshape(joints, 10, sets, -1)
        tau = self._torque(*self._states(q, dq, ddq), v)
        return tau.reshape(joints, sets, batch, count).permute(2, 1, 3, 0)

    def energy_slopes(
        self, q: Tensor, dq: Tensor, ddq: Tensor, parameters: Tensor, weights: Tensor
    ) -> list[Tensor]:
        """Gradients in q, dq and ddq, (B, T, J) each, of Σ weight · |Y v|² over K vectors v and time.

        Args:
            q: joint position, (B, T, J).
            dq: joint velocity, (B, T, J).
            ddq: joint acceleration, (B, T, J).
            parameters: the vectors v, (B, K, 10 J).
            weights: (B, K).
        """
        self._check(q, dq, ddq)
        if kernels.usable(q, dq, ddq, parameters, weights):
            return kernels.energy_slopes(self.chain, (q, dq, ddq), parameters, weights)
        with torch.enable_grad():
            q, dq, ddq = (x.detach().requires_grad_(True) for x in (q, dq, ddq))
            energy = (self.torques_of(q, dq, ddq, parameters) ** 2).sum((2, 3))
            return list(torch.autograd.grad((weights * energy).sum(), (q, dq, ddq)))

    def _check(self, q: Tensor, dq: Tensor, ddq: Tensor) -> None:
        for name, x in (("position", q), ("velocity", dq), ("acceleration", ddq)):
            if x.shape != q.shape or x.shape[-1:] != (self.joints,):
                raise ShapeError(f"{name} is {tuple(x.shape)}, expected (…, {self.joints}), all three alike")

    def _states(self, q: Tensor, dq: Tensor, ddq: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        self._check(q, dq, ddq)
        q, dq, ddq = (x.reshape(-1, self.joints).T.contiguous() for x in (q, dq, ddq))
        return q, dq, ddq

    def _links(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Iterator[tuple[int, "_LinkMotion"]]:
        """Motion of each link's frame, in that frame, from the base outwards."""
        w = q.new_zeros(3, q.shape[1])
        alpha = torch.zeros_like(w)
        a = -self.arm.gravity.to(q)[:, None].expand(3, q.shape[1])
        for i in range(self.joints):
            turn, shift, axis = joint_placement(self.arm, i, q[i])
            sliding = bool(self.arm.prismatic[i])
            a = rotate(turn, a + cross(alpha, shift) + cross(w, cross(w, shift)))
            w, alpha = rotate(turn, w), rotate(turn, alpha)
            rate, kick = axis * dq[i], axis * ddq[i]
            if sliding:
                a = a + kick + 2 * cross(w, rate)
            else:
                alpha = alpha + kick + cross(w, rate)
                w = w + rate
            yield i, _LinkMotion(turn, shift, axis, sliding, w, alpha, a)

    def _regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Full regressor with states last, (J, 10 J, N)."""
        n = q.shape[1]
        turns = linear = q.new_zeros(3, 0, n)  # joint j's screw at this link: turn and speed of its origin
        blocks = []
        for i, link in self._links(q, dq, ddq):
            linear = rotate(link.turn, linear + cross(turns, link.shift[:, None]))
            turns = rotate(link.turn, turns)
            axis = link.axis[:, None].expand(3, 1, n)
            still = torch.zeros_like(axis)
            turns = torch.cat([turns, still if link.sliding else axis], 1)
            linear = torch.cat([linear, axis if link.sliding else still], 1)
            block = _link_columns(link, turns, linear)
            blocks.append(torch.cat([block, block.new_zeros(self.joints - i - 1, 10, n)]))
        return torch.cat(blocks, 1)

    def _torque(self, q: Tensor, dq: Tensor, ddq: Tensor, v: Tensor) -> Tensor:
        """Torque with states last, (J, K, N), of parameters (J, 10, K, N) or (J, 10, K, 1)."""
        links, wrenches = [], []
        for i, link in self._links(q, dq, ddq):
            links.append(link)
            wrenches.append(_link_wrench(link, v[i]))
        torque: list[Tensor] = []
        force = moment = None
        for i in reversed(range(self.joints)):
            f, m = wrenches[i]
            if force is not None and moment is not None:
                child = links[i + 1]
                force = unrotate(child.turn, force)
                moment = unrotate(child.turn, moment) + cross(child.shift[:, None], force)
                f, m = f + force, m + moment
            force, moment = f, m
            carried = force if links[i].sliding else moment
            torque.append((links[i].axis[:, None] * carried).sum(0))
        return torch.stack(torque[::-1])


@dataclass(frozen=True)
class _LinkMotion:
    turn: Tensor  # (3, 3, N) rotation of the link's frame in its parent's
    shift: Tensor  # (3, N) origin of the link's frame in its parent's
    axis: Tensor  # (3, 1) joint axis in the link's frame
    sliding: bool
    w: Tensor  # (3, N) angular velocity
    alpha: Tensor  # (3, N) angular acceleration
    a: Tensor  # (3, N) acceleration of the origin, less gravity


def joint_placement(arm: Arm, i: int, q: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Rotation (3, 3, N) and origin (3, N) [m] of joint ``i``'s frame in its parent's; its axis (3, 1)."""
    rotation, origin, axis = (x[i].to(q) for x in (arm.rotation, arm.translation, arm.axis))
    if arm.prismatic[i]:
        n = len(q)
        return (
            rotation[..., None].expand(3, 3, n),
            origin[:, None] + (rotation @ axis)[:, None] * q,
            axis[:, None],
        )
    x, y, z = axis.unbind()
    zero = torch.zeros_like(x)
    k = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3)
    fixed, sine, cosine = rotation @ (torch.eye(3).to(q) + k @ k), rotation @ k, -rotation @ k @ k
    turn = fixed[..., None] + sine[..., None] * torch.sin(q) + cosine[..., None] * torch.cos(q)
    return turn, origin[:, None].expand(3, len(q)), axis[:, None]


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Cross product over the leading dimension, (3, …)."""
    # Here and below: the gradient of one unbind is one stack, that of nine selections is nine full arrays.
    (a0, a1, a2), (b0, b1, b2) = a.unbind(), b.unbind()
    return torch.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def unrotate(turn: Tensor, x: Tensor) -> Tensor:
    """Vectors (3, …, N) of the child's frame, in the parent's."""
    x0, x1, x2 = x.unbind()
    return torch.stack(
        [r0 * x0 + r1 * x1 + r2 * x2 for r0, r1, r2 in (row.unbind() for row in turn.unbind())]
    )


def rotate(turn: Tensor, x: Tensor) -> Tensor:
    """Vectors (3, …, N) of the parent's frame, in the child's."""
    x0, x1, x2 = x.unbind()
    rows = (row.unbind() for row in turn.unbind())
    return torch.stack([r0 * x0 + r1 * x1 + r2 * x2 for r0, r1, r2 in zip(*rows)])


def _inertia_columns(u: Tensor, v: Tensor) -> list[Tensor]:
    """uᵀ (I v) as the six columns of I in Pinocchio's order, each (…, N)."""
    return [
        u[0] * v[0],
        u[0] * v[1] + u[1] * v[0],
        u[1] * v[1],
        u[0] * v[2] + u[2] * v[0],
        u[1] * v[2] + u[2] * v[1],
        u[2] * v[2],
    ]


def _link_columns(link: _LinkMotion, turns: Tensor, linear: Tensor) -> Tensor:
    """The link's ten columns seen by every joint up to its own, (i + 1, 10, N)."""
    w, alpha, a = link.w[:, None], link.alpha[:, None], link.a[:, None]
    # Transposed spin matrix ([α]× + [ω]×[ω]×)ᵀ applied to the joints' linear speeds.
    spin = cross(linear, alpha) + w * (w * linear).sum(0) - linear * (w * w).sum(0)
    first = spin + cross(a, turns)
    about_alpha, about_w = _inertia_columns(turns, alpha), _inertia_columns(cross(turns, w), w)
    second = [x + y for x, y in zip(about_alpha, about_w)]
    return torch.stack([(linear * a).sum(0), *first, *second], 1)


def _link_wrench(link: _LinkMotion, v: Tensor) -> tuple[Tensor, Tensor]:
    """Force and moment about the link's origin, (3, K, N) each, of parameters (10, K, N)."""
    w, alpha, a = link.w[:, None], link.alpha[:, None], link.a[:, None]
    mass, first = v[0], v[1:4]
    force = mass * a + cross(alpha, first) + w * (w * first).sum(0) - first * (w * w).sum(0)
    moment = cross(first, a) + _inertia_times(v, alpha) + cross(w, _inertia_times(v, w))
    return force, moment


def _inertia_times(v: Tensor, x: Tensor) -> Tensor:
    xx, xy, yy, xz, yz, zz = v[4:]
    return torch.stack(
        [
            xx * x[0] + xy * x[1] + xz * x[2],
            xy * x[0] + yy * x[1] + yz * x[2],
            xz * x[0] + yz * x[1] + zz * x[2],
        ],
    )


def _base_parameters(body: RigidBody) -> BaseParameters:
    """Independent columns and the map onto them, from 60 random states per joint.

    The columns are the first linearly independent ones in Pinocchio's order, so that the choice is
    deterministic. Columns that are rounding noise are dropped before any is normalised.

    Raises:
        RobotError: when no parameter has any effect on the torques.
    """
    arm = body.arm
    random = torch.Generator().manual_seed(0)
    draw = (
        torch.rand(3, 60 * arm.joints, arm.joints, generator=random, dtype=torch.float64) * 2 - 1
    ).unbind()
    span = (arm.position_upper - arm.position_lower) / 2
    q = (arm.position_upper + arm.position_lower) / 2 + span * draw[0]
    y = body.regressor(q, draw[1] * arm.velocity_limit, draw[2] * 5.0).reshape(-1, 10 * arm.joints).numpy()
    norms = np.linalg.norm(y, axis=0)
    if not norms.max() > 0:
        raise RobotError(f"no inertial parameter of {arm.name} has an effect on its joint torques")
    alive = np.flatnonzero(norms > _RANK_TOLERANCE * norms.max())
    unit = y[:, alive] / norms[alive]
    pivots = np.abs(np.diag(qr(unit, mode="economic", pivoting=True)[1]))
    rank = int((pivots > _RANK_TOLERANCE * pivots[0]).sum())
    columns = alive[_first_independent(unit, rank)]
    mapping = np.linalg.lstsq(y[:, columns] / norms[columns], y, rcond=None)[0] / norms[columns][:, None]
    mapping[np.abs(mapping) < 1e-10] = 0.0
    mapping[:, columns] = np.eye(rank)
    subspace = np.linalg.cholesky(mapping @ mapping.T)
    values = mapping @ arm.inertial_parameters.reshape(-1).numpy()
    names = tuple(f"{LINK_PARAMETERS[c % 10]}{c // 10 + 1}" for c in columns)
    return BaseParameters(
        columns=torch.from_numpy(columns),
        mapping=torch.from_numpy(mapping),
        values=torch.from_numpy(values),
        subspace=torch.from_numpy(subspace),
        names=names,
    )


def _first_independent(unit: np.ndarray, rank: int) -> np.ndarray:
    """Indices of the first ``rank`` linearly independent columns, from left to right."""
    leading = np.abs(np.diag(np.linalg.qr(unit)[1]))
    return np.sort(np.argsort(-leading, kind="stable")[:rank])


def gram(body: RigidBody, trajectory: Trajectory, c: Tensor, samples: int = 80) -> Tensor:
    """Gram matrices YᵀY / T of the base regressor, summed over joints, (B, p, p).

    Without gradients it works in about 150 MB beside its result, whatever the number of
    trajectories, samples and joints: the regressor exists for a few thousand states at a time.

    Args:
        body: the arm's dynamics.
        trajectory: the family of trajectories.
        c: coefficients [rad/s], (B, J, H, 2).
        samples: time points per trajectory, cell centres.

    Raises:
        ShapeError: when the coefficients fit neither the trajectory nor the arm, or are not finite.
    """
    times = trajectory.grid(samples)
    most = _states_at_once(body)
    if kernels.usable(c):
        most = min(most, _STATES_IN_CACHE * torch.get_num_threads())
    batch = max(1, most // samples)
    pieces = [gram_of(body, *trajectory.roll_out(part, times)[1:]) for part in c.split(batch)]
    return torch.cat(pieces)


def _states_at_once(body: RigidBody) -> int:
    return max(1, _VALUES_AT_ONCE // (10 * body.joints**2))


def gram_of(body: RigidBody, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
    """Gram matrices YᵀY / T of the base regressor, (B, p, p), at states (B, T, J)."""
    count = q.shape[1]
    most = _states_at_once(body)
    if count > most:
        parts = zip(*(x.split(most, 1) for x in (q, dq, ddq)))
        return torch.stack([gram_of(body, *part) * part[0].shape[1] for part in parts]).sum(0) / count
    if kernels.usable(q, dq, ddq):
        body._check(q, dq, ddq)
        return kernels.gram(body.chain, body.base.columns, (q, dq, ddq), partial(_plain_gram, body))
    return _plain_gram(body, q, dq, ddq)


def _plain_gram(body: RigidBody, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
    batch, count, joints = q.shape
    columns = body.base.columns.to(q.device)
    y = body._regressor(*body._states(q, dq, ddq))[:, columns]
    y = y.reshape(joints, len(columns), batch, count).permute(2, 1, 0, 3).flatten(2)
    return y @ y.transpose(1, 2) / count
