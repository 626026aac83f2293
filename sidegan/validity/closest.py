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


def _closest(constraints: Constraints, q: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Which, distance and points of some states."""
    with torch.no_grad():
        margins = constraints.at_rest(q)
        checked = [margins[name] for name in ("collision", "keep_out") if name in margins]
        distance, which = torch.cat(checked, 1).min(1)
    return which, distance + constraints.clearance, _points(constraints, q, which)


@torch.enable_grad()
def _points(constraints: Constraints, q: Tensor, which: Tensor) -> Tensor:
    """Nearest points [m], (N, 2, 3), of the capsules of these pairs, or of a capsule and its region.

    A distance grows at unit rate along the line between the nearest points, so that its slopes in the ends of
    a capsule's axis tell the direction, and by their sizes where on the axis the nearest point is.
    """
    axes, points = torch.stack(capsule_axes(constraints.arm, q.T.contiguous())), q.new_zeros(len(q), 2, 3)
    radius, count = constraints.arm.capsules.radius.to(q), len(constraints.pairs)
    states = torch.nonzero(which < count)[:, 0]
    first, second = constraints.pairs[which[states]].unbind(1)
    one, other = (axes[:, :, side, states].requires_grad_() for side in (first, second))
    apart = segment_distance(*one, *other)
    for k, (axis, side) in enumerate(((one, first), (other, second))):
        spot, away = _on_axis(axis, apart)
        points[states, k] = spot - radius[side][:, None] * away
    for index, region in enumerate(constraints.regions):
        ours = torch.nonzero(constraints.guarded[:, 0] == index)[:, 0] + count
        states = torch.nonzero(torch.isin(which, ours))[:, 0]
        side = constraints.guarded[which[states] - count, 1]
        axis = axes[:, :, side, states].requires_grad_()
        apart = region.margin(*axis)
        spot, away = _on_axis(axis, apart)
        points[states, 0] = spot - radius[side][:, None] * away
        points[states, 1] = spot - apart.detach()[:, None] * away
    return points


def _on_axis(axis: Tensor, distance: Tensor) -> tuple[Tensor, Tensor]:
    """The nearest point of axes, (2, 3, N), and the direction away from what is near, (N, 3) each."""
    (slope,) = torch.autograd.grad(distance.sum(), axis, retain_graph=True)
    at_a, at_b = slope.norm(dim=1)
    share = at_b / (at_a + at_b).clamp_min(torch.finfo(axis.dtype).tiny)
    away = torch.nn.functional.normalize(slope.sum(0), dim=0)
    a, b = axis.detach()
    return torch.lerp(a, b, share).T, away.T
