"""The recursive Newton–Euler algorithm in plain torch, and the regressor that follows from it.

Everything runs over N states at once with the states in the last, contiguous dimension: states are (J, N),
and the vectors of ``compiled.formulas`` are tuples of three tensors (N,), or (K, N) where there are several
for each state. Link frames follow the arm's joint frames.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.motion.compiled.chain import Chain
from sidegan.motion.compiled.formulas import (
    Matrix,
    Motion,
    Moving,
    Vector,
    add,
    carried,
    carried_rate,
    columns_of,
    cross,
    dot,
    moved,
    moved_rate,
    times,
    to_child,
    wrench_of,
    wrench_rate,
)

States = Sequence[Tensor]


class _Link(NamedTuple):
    axis: Vector
    slides: float  # 1 or 0
    turn: Matrix
    shift: Vector
    motion: Motion


def states_last(states: States) -> list[Tensor]:
    """States (…, J) as this algorithm takes them, (J, N) each."""
    return [x.reshape(-1, x.shape[-1]).T.contiguous() for x in states]


def regressor(chain: Chain, states: States) -> Tensor:
    """Full regressor, (J, 10 J, N), of joint position, velocity and acceleration.

    Source: Atkeson, An, Hollerbach 1986; columns in Pinocchio's order.
    """
    joints, n = states[0].shape
    turns = linear = (
        states[0].new_zeros(0, n),
    ) * 3  # joint j's screw at this link: turn, and speed of its origin
    blocks = []
    for i, link in enumerate(_links(chain, *states)):
        linear = to_child(link.turn, add(linear, cross(turns, link.shift)))
        turns = to_child(link.turn, turns)
        turns, linear = (
            _append(turns, times(1.0 - link.slides, link.axis)),
            _append(linear, times(link.slides, link.axis)),
        )
        block = torch.stack(columns_of(link.motion, turns, linear), 1)
        blocks.append(torch.cat([block, block.new_zeros(joints - i - 1, 10, n)]))
    return torch.cat(blocks, 1)


def torque(chain: Chain, states: States, parameters: Tensor) -> Tensor:
    """Torque, (J, K, N), of inertial parameters (J, 10, K, N) or (J, 10, K, 1)."""
    links = list(_links(chain, *states))
    own = [wrench_of(v.unbind(), link.motion) for link, v in zip(links, parameters)]
    torques: list[Tensor] = []
    wrench = None
    for link, (force, moment) in zip(reversed(links), reversed(own)):
        if wrench is not None:
            force, moment = add(force, wrench[0]), add(moment, wrench[1])
        torques.append(dot(link.axis, force if link.slides else moment))
        wrench = carried(link.turn, link.shift, (force, moment))
    return torch.stack(torques[::-1])


def torque_rates(chain: Chain, states: States, parameters: Tensor) -> Tensor:
    """Rates of the torques, (J, N), of positions and three derivatives, and inertial parameters (J, 10)."""
    q, dq, ddq, jerk = states
    zero = torch.zeros_like(q[0])
    x, y, z = (zero - g for g in chain.gravity.tolist())
    still = zero, zero, zero
    at: Moving = (still, still, (x, y, z)), (still, still, still)
    joints, wrenches = [], []
    for i, axis in enumerate(chain.axis.tolist()):
        slides, (turn, shift) = float(chain.prismatic[i]), placement(chain, i, q[i])
        slide = torch.from_numpy(chain.slide[i]).to(q)[:, None] * dq[i]
        shifts, v = (shift, (slide[0], slide[1], slide[2])), tuple(parameters[i].unbind())
        at = moved_rate((axis, slides), turn, shifts, (dq[i], ddq[i], jerk[i]), at)
        joints.append((axis, slides, turn, shifts, times((1.0 - slides) * dq[i], axis)))
        wrenches.append((wrench_of(v, at[0]), wrench_rate(v, at)))
    wrench = rate = still, still
    rates = []
    for (axis, slides, turn, shifts, spin), (own, change) in zip(reversed(joints), reversed(wrenches)):
        wrench = add(wrench[0], own[0]), add(wrench[1], own[1])
        rate = add(rate[0], change[0]), add(rate[1], change[1])
        rates.append(dot(axis, rate[0] if slides else rate[1]))
        rate = carried_rate(spin, turn, shifts, wrench, rate)
        wrench = carried(turn, shifts[0], wrench)
    return torch.stack(rates[::-1])


def placement(chain: Chain, i: int, q: Tensor) -> tuple[Matrix, Vector]:
    """Rotation and origin [m] of joint ``i``'s frame in its parent's, of tensors (N,), at positions (N,)."""
    fixed, sine, cosine, origin, slide = (torch.from_numpy(x[i]).to(q)[:, None] for x in chain[1:6])
    r = (fixed + sine * torch.sin(q) + cosine * torch.cos(q)).unbind()
    x, y, z = (origin + slide * q).unbind()
    return ((r[0], r[1], r[2]), (r[3], r[4], r[5]), (r[6], r[7], r[8])), (x, y, z)


def _links(chain: Chain, q: Tensor, dq: Tensor, ddq: Tensor) -> Iterator[_Link]:
    """Motion of each link's frame, in that frame, from the base outwards."""
    zero = torch.zeros_like(q[0])
    x, y, z = (zero - g for g in chain.gravity.tolist())
    motion = (zero, zero, zero), (zero, zero, zero), (x, y, z)
    for i, axis in enumerate(chain.axis.tolist()):
        turn, shift = placement(chain, i, q[i])
        slides = float(chain.prismatic[i])
        motion = moved(axis, slides, turn, shift, (dq[i], ddq[i]), motion)
        yield _Link(axis, slides, turn, shift, motion)


def _append(vectors: Vector, other: Vector) -> Vector:
    """One more vector behind K, (K, N) each."""
    x, y, z = (torch.cat([v, v.new_full((1, v.shape[1]), a)]) for v, a in zip(vectors, other))
    return x, y, z
