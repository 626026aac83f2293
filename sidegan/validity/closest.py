"""What is nearest to touching at each moment, and where: for pictures."""

from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.validity.capsules import capsule_axes, segment_distance
from sidegan.validity.constraints import Constraints

_AT_ONCE = 1_000  # states: bounds the memory to some tens of megabytes


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


@torch.enable_grad()
def _closest(constraints: Constraints, q: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Which, distance and points of some states.

    A distance grows at unit rate along the line between the nearest points, so that its slopes in the ends of
    a capsule's axis tell the direction, and by their sizes where on the axis the nearest point is.
    """
    capsules = constraints.arm.capsules
    a, b = (ends.detach().requires_grad_() for ends in capsule_axes(constraints.arm, q.T.contiguous()))
    radius = capsules.radius.to(q)
    pairs = constraints.pairs
    first, second = pairs.unbind(1)
    rows = [segment_distance(a[:, first], b[:, first], a[:, second], b[:, second]) - _sums(radius, pairs)]
    for index, region in enumerate(constraints.regions):
        guarded = constraints.guarded[constraints.guarded[:, 0] == index, 1]
        rows.append(region.margin(a[:, guarded], b[:, guarded]) - radius[guarded][:, None])
    distance, which = torch.cat(rows).min(0)
    slopes = torch.autograd.grad(distance.sum(), (a, b))
    sides = torch.cat([pairs, constraints.guarded[:, 1:].expand(-1, 2)])[which]  # of a guarded link: itself
    with torch.no_grad():
        near = torch.stack([_point(a, b, slopes, radius, sides[:, k]) for k in range(2)], 1)
        alone = (which >= len(pairs))[:, None]
        away = _direction(slopes, sides[:, 0])
        near[:, 1] = torch.where(alone, near[:, 0] - distance[:, None] * away, near[:, 1])
    return which, distance.detach(), near


def _sums(radius: Tensor, pairs: Tensor) -> Tensor:
    return radius[pairs].sum(1)[:, None]


def _direction(slopes: tuple[Tensor, ...], side: Tensor) -> Tensor:
    """Unit direction in which a capsule leaves what is nearest, (N, 3)."""
    states = torch.arange(len(side))
    total = sum(slope[:, side, states].T for slope in slopes)
    return torch.nn.functional.normalize(torch.as_tensor(total), dim=1)


def _point(a: Tensor, b: Tensor, slopes: tuple[Tensor, ...], radius: Tensor, side: Tensor) -> Tensor:
    """Nearest point on a capsule's surface [m], (N, 3)."""
    states = torch.arange(len(side))
    at_a, at_b = (slope[:, side, states].norm(dim=0) for slope in slopes)
    share = at_b / (at_a + at_b).clamp_min(torch.finfo(a.dtype).tiny)
    axis = torch.lerp(a[:, side, states], b[:, side, states], share).T
    return axis - radius[side][:, None] * _direction(slopes, side)
