"""What is nearest to touching at each moment, and where: for pictures."""

from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are used
import torch
from torch import Tensor

from sidegan.validity.capsules import capsule_axes, frames_of, nearest_on_segments
from sidegan.validity.constraints import Constraints

_AT_ONCE = 1_000  # states: bounds the memory to some tens of megabytes
_TOUCHING = 1e-7  # [m] below it two hulls touch
_WORTH = 1e4  # [m] of a sum of shares beside distances: leaves an error of 1e-8 of a length


class Closest(NamedTuple):
    """The closest of all checked pairs and guarded links, in N states."""

    names: tuple[str, ...]  # of the pairs, then of the guarded links
    which: Tensor  # of these, (N,)
    distance: Tensor  # [m], (N,)
    points: Tensor  # the nearest points of both [m], (N, 2, 3)


def closest(constraints: Constraints, q: Tensor) -> Closest | None:
    """The closest pair at positions (N, J); None where nothing is checked."""
    names = (*constraints.labels.get("collision", ()), *constraints.labels.get("keep_out", ()))
    if not names:
        return None
    parts = [_closest(constraints, part) for part in q.split(_AT_ONCE)]
    return Closest(names, *(torch.cat(x) for x in zip(*parts)))


def _closest(constraints: Constraints, q: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Which, distance and points of some states."""
    with torch.no_grad():
        margins = constraints.at_rest(q)
        lower = torch.cat([margins[name] + x for name, x in constraints.kept.items() if name in margins], 1)
        known = ~_finer(constraints).expand_as(lower).clone()
        while True:  # capsules tell too little: what is nearest is looked into until it stays so
            distance, which = lower.min(1)
            rows = torch.nonzero(~known.gather(1, which[:, None])[:, 0])[:, 0]
            if not len(rows):
                break
            inner = constraints.pieces.lower(q, torch.stack([rows, which[rows]], 1))
            lower[rows, which[rows]] = torch.maximum(distance[rows], inner + constraints.apart)
            known[rows, which[rows]] = True
    return which, distance, _points(constraints, q, which)


def _finer(constraints: Constraints) -> Tensor:
    """Which of the pairs and the guarded links have something inside of their capsules that is looked at."""
    return torch.cat([constraints.pieces.finer, torch.zeros(len(constraints.guarded), dtype=torch.bool)])


@torch.enable_grad()
def _points(constraints: Constraints, q: Tensor, which: Tensor) -> Tensor:
    """Nearest points [m], (N, 2, 3), of what these pairs are, or of a capsule and its region.

    A capsule's distance from a region grows at unit rate along the line between the nearest points, so that
    its slopes in the ends of the axis tell the direction, and by their sizes where on the axis the nearest
    point is.
    """
    axes, points = torch.stack(capsule_axes(constraints.arm, q.T.contiguous())), q.new_zeros(len(q), 2, 3)
    radius, count = constraints.arm.capsules.radius.to(q), len(constraints.pairs)
    states = torch.nonzero(which < count)[:, 0]
    first, second = constraints.pairs[which[states]].unbind(1)
    one, other = nearest_on_segments(*axes[:, :, first, states], *axes[:, :, second, states])
    towards = torch.nn.functional.normalize(other - one, dim=0)
    points[states, 0] = (one + radius[first] * towards).T
    points[states, 1] = (other - radius[second] * towards).T
    _put_pieces(constraints, q, which, points)
    for index, region in enumerate((*constraints.regions, *constraints.lowered)):
        ours = torch.nonzero(constraints.guarded[:, 0] == index)[:, 0] + count
        states = torch.nonzero(torch.isin(which, ours))[:, 0]
        side = constraints.guarded[which[states] - count, 1]
        axis = axes[:, :, side, states].requires_grad_()
        apart = region.margin(*axis)
        spot, away = _on_axis(axis, apart)
        points[states, 0] = spot - radius[side][:, None] * away
        points[states, 1] = spot - apart.detach()[:, None] * away
    return points


def _put_pieces(constraints: Constraints, q: Tensor, which: Tensor, points: Tensor) -> None:
    """Put the nearest points of pieces, where they are apart, in the place of those of their capsules."""
    pieces, links = constraints.arm.capsules.pieces, constraints.arm.capsules.link
    states = torch.nonzero(_finer(constraints)[which])[:, 0]
    if pieces is None or not len(states):
        return
    turns, places = frames_of(constraints.arm, q[states].T.contiguous())
    corners = pieces.corners.split(pieces.start.diff().tolist())
    for n, state in enumerate(states.tolist()):
        pair = constraints.pairs[which[state]]
        frames = [(corners[c], int(links[c]) + 1) for c in pair.tolist()]
        bodies = [x @ turns[k, :, :, n].T + places[k, :, n] for x, k in frames]
        one, other = _nearest_in_hulls(*bodies)
        if (gap := other - one).norm() > _TOUCHING:
            towards = gap / gap.norm()
            points[state, 0] = one + pieces.radius[pair[0]] * towards
            points[state, 1] = other - pieces.radius[pair[1]] * towards


def _nearest_in_hulls(one: Tensor, other: Tensor) -> tuple[Tensor, Tensor]:
    """The points of two hulls of corners (V, 3) and (W, 3) that are nearest to each other, (3,) each.

    The shares of the corners, by least squares with none below zero, and a sum of one that is worth much more
    than the distance.
    """
    signs = torch.block_diag(torch.ones(1, len(one)), torch.ones(1, len(other))).double()
    rows = torch.cat([torch.cat([one, -other]).T, _WORTH * signs])
    shares, _ = scipy.optimize.nnls(rows.numpy(), np.array([0.0, 0.0, 0.0, _WORTH, _WORTH]))
    first, second = torch.from_numpy(shares).split([len(one), len(other)])
    return first @ one / first.sum(), second @ other / second.sum()


def _on_axis(axis: Tensor, distance: Tensor) -> tuple[Tensor, Tensor]:
    """The nearest point of axes, (2, 3, N), and the direction away from what is near, (N, 3) each."""
    (slope,) = torch.autograd.grad(distance.sum(), axis, retain_graph=True)
    at_a, at_b = slope.norm(dim=1)
    share = at_b / (at_a + at_b).clamp_min(torch.finfo(axis.dtype).tiny)
    away = torch.nn.functional.normalize(slope.sum(0), dim=0)
    a, b = axis.detach()
    return torch.lerp(a, b, share).T, away.T
