"""Where an arm's capsules are, and how far apart, in many configurations at a time."""

import torch
from torch import Tensor

from sidegan.motion.arrays import chain_of
from sidegan.robot import Arm

_PARALLEL = 1e-15  # squared sine of an angle that is rounding noise


def capsule_axes(arm: Arm, q: Tensor) -> tuple[Tensor, Tensor]:
    """World end points [m] of each capsule's axis, two of (3, C, N), at joint positions (J, N)."""
    capsules = arm.capsules
    placed = place_points(arm, q, torch.cat([capsules.a, capsules.b]), capsules.link.repeat(2))
    count = len(capsules.radius)
    return placed[:, :count], placed[:, count:]


def place_points(arm: Arm, q: Tensor, points: Tensor, links: Tensor) -> Tensor:
    """World positions [m], (3, K, N), of points (K, 3) fixed to links (K,), -1 for the base."""
    placed, (turns, places) = q.new_empty(3, len(points), q.shape[1]), frames_of(arm, q)
    for link in torch.unique(links).tolist():
        mine = links == link
        placed[:, mine] = (
            torch.einsum("ijn,kj->ikn", turns[link + 1], points[mine]) + places[link + 1][:, None]
        )
    return placed


def frames_of(arm: Arm, q: Tensor) -> tuple[Tensor, Tensor]:
    """Rotations (J + 1, 3, 3, N) and origins [m], (J + 1, 3, N), of the base and the joints, at (J, N)."""
    fixed, sine, cosine, origin, slide = (torch.from_numpy(x)[..., None] for x in chain_of(arm)[1:6])
    turns, places = [torch.eye(3).to(q)[..., None].expand(3, 3, q.shape[1])], [q.new_zeros(3, q.shape[1])]
    for i, x in enumerate(q):
        own = (fixed[i] + sine[i] * torch.sin(x) + cosine[i] * torch.cos(x)).unflatten(0, (3, 3))
        places.append(places[-1] + (turns[-1] * (origin[i] + slide[i] * x)).sum(1))
        turns.append((turns[-1][:, :, None] * own).sum(1))
    return torch.stack(turns), torch.stack(places)


def segment_distance(a1: Tensor, b1: Tensor, a2: Tensor, b2: Tensor) -> Tensor:
    """Distance [m], (…), between segments with end points (3, …).

    Good to 1e-7 of a length in the worst case, two segments that nearly coincide.
    """
    one, two = nearest_on_segments(a1, b1, a2, b2)
    gap = one - two
    return (gap * gap).sum(0).sqrt()


def nearest_on_segments(a1: Tensor, b1: Tensor, a2: Tensor, b2: Tensor) -> tuple[Tensor, Tensor]:
    """The nearest points [m], (3, …) each, of segments with end points (3, …).

    Source: Ericson 2005, section 5.1.9.
    """
    tiny = torch.finfo(a1.dtype).tiny
    u, v, r = b1 - a1, b2 - a2, a1 - a2
    uu, vv, uv = (u * u).sum(0), (v * v).sum(0), (u * v).sum(0)
    ur, vr = (u * r).sum(0), (v * r).sum(0)
    determinant = uu * vv - uv * uv
    crossing = determinant > _PARALLEL * uu * vv
    s = torch.where(crossing, (uv * vr - ur * vv) / determinant.clamp_min(tiny), 0.0).clamp(0, 1)
    t = ((uv * s + vr) / vv.clamp_min(tiny)).clamp(0, 1)
    s = ((uv * t - ur) / uu.clamp_min(tiny)).clamp(0, 1)
    return torch.lerp(a1, b1, s), torch.lerp(a2, b2, t)
