"""The recursive Newton–Euler algorithm in plain torch, and the regressor that follows from it.

Everything runs over N states at once with the states in the last, contiguous dimension: states are (J, N),
vectors (3, N) and joint-wise stacks (3, K, N). Link frames follow the arm's joint frames.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.robot import Arm

States = Sequence[Tensor]


@dataclass(frozen=True)
class _Link:
    turn: Tensor  # (3, 3, N) rotation of the link's frame in its parent's
    shift: Tensor  # (3, N) origin of the link's frame in its parent's
    axis: Tensor  # (3, 1) joint axis in the link's frame
    sliding: bool
    w: Tensor  # (3, N) angular velocity
    alpha: Tensor  # (3, N) angular acceleration
    a: Tensor  # (3, N) acceleration of the origin, less gravity


def states_last(states: States) -> list[Tensor]:
    """States (…, J) as this algorithm takes them, (J, N) each."""
    return [x.reshape(-1, x.shape[-1]).T.contiguous() for x in states]


def regressor(arm: Arm, states: States) -> Tensor:
    """Full regressor, (J, 10 J, N), of joint position, velocity and acceleration.

    Source: Atkeson, An, Hollerbach 1986; columns in Pinocchio's order.
    """
    n = states[0].shape[1]
    turns = linear = states[0].new_zeros(
        3, 0, n
    )  # joint j's screw at this link: turn and speed of its origin
    blocks = []
    for i, link in enumerate(_links(arm, *states)):
        linear = rotate(link.turn, linear + cross(turns, link.shift[:, None]))
        turns = rotate(link.turn, turns)
        axis = link.axis[:, None].expand(3, 1, n)
        still = torch.zeros_like(axis)
        turns = torch.cat([turns, still if link.sliding else axis], 1)
        linear = torch.cat([linear, axis if link.sliding else still], 1)
        block = _columns(link, turns, linear)
        blocks.append(torch.cat([block, block.new_zeros(arm.joints - i - 1, 10, n)]))
    return torch.cat(blocks, 1)


def torque(arm: Arm, states: States, parameters: Tensor) -> Tensor:
    """Torque, (J, K, N), of inertial parameters (J, 10, K, N) or (J, 10, K, 1)."""
    links = list(_links(arm, *states))
    wrenches = [_wrench(link, v) for link, v in zip(links, parameters)]
    torques: list[Tensor] = []
    force = moment = torch.zeros_like(wrenches[-1][0])
    for link, (own_force, own_moment) in zip(reversed(links), reversed(wrenches)):
        force, moment = own_force + force, own_moment + moment
        torques.append((link.axis[:, None] * (force if link.sliding else moment)).sum(0))
        force = unrotate(link.turn, force)
        moment = unrotate(link.turn, moment) + cross(link.shift[:, None], force)
    return torch.stack(torques[::-1])


def joint_placement(arm: Arm, i: int, q: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Rotation (3, 3, N) and origin (3, N) [m] of joint ``i``'s frame in its parent's; its axis (3, 1)."""
    rotation, origin, axis = (x[i].to(q) for x in (arm.rotation, arm.translation, arm.axis))
    if arm.prismatic[i]:
        turn = rotation[..., None].expand(3, 3, len(q))
        return turn, origin[:, None] + (rotation @ axis)[:, None] * q, axis[:, None]
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


def _links(arm: Arm, q: Tensor, dq: Tensor, ddq: Tensor) -> Iterator[_Link]:
    """Motion of each link's frame, in that frame, from the base outwards."""
    w = q.new_zeros(3, q.shape[1])
    alpha = torch.zeros_like(w)
    a = -arm.gravity.to(q)[:, None].expand(3, q.shape[1])
    for i in range(arm.joints):
        turn, shift, axis = joint_placement(arm, i, q[i])
        sliding = bool(arm.prismatic[i])
        a = rotate(turn, a + cross(alpha, shift) + cross(w, cross(w, shift)))
        w, alpha = rotate(turn, w), rotate(turn, alpha)
        rate, kick = axis * dq[i], axis * ddq[i]
        if sliding:
            a = a + kick + 2 * cross(w, rate)
        else:
            alpha = alpha + kick + cross(w, rate)
            w = w + rate
        yield _Link(turn, shift, axis, sliding, w, alpha, a)


def _columns(link: _Link, turns: Tensor, linear: Tensor) -> Tensor:
    """The link's ten columns seen by every joint up to its own, (i + 1, 10, N)."""
    w, alpha, a = link.w[:, None], link.alpha[:, None], link.a[:, None]
    # Transposed spin matrix ([α]× + [ω]×[ω]×)ᵀ applied to the joints' linear speeds.
    spin = cross(linear, alpha) + w * (w * linear).sum(0) - linear * (w * w).sum(0)
    first = spin + cross(a, turns)
    about_alpha, about_w = _inertia_columns(turns, alpha), _inertia_columns(cross(turns, w), w)
    second = [x + y for x, y in zip(about_alpha, about_w)]
    return torch.stack([(linear * a).sum(0), *first, *second], 1)


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


def _wrench(link: _Link, v: Tensor) -> tuple[Tensor, Tensor]:
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
