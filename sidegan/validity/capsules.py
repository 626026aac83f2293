"""Where an arm's capsules are, and how far apart: in torch, batched and differentiable."""

import torch
from torch import Tensor

from sidegan.motion.compiled.chain import Chain
from sidegan.motion.compiled.formulas import Matrix, Vector, add, product, to_parent
from sidegan.motion.newton_euler import placement
from sidegan.robot import Arm

_PARALLEL = 1e-15  # squared sine of an angle that is rounding noise
_TOUCHING = 1e-12  # [m] keeps the gradient of a distance finite where it vanishes


def capsule_axes(arm: Arm, q: Tensor) -> tuple[Tensor, Tensor]:
    """World end points [m] of each capsule's axis, two of (3, C, N), at joint positions (J, N)."""
    points = torch.cat([arm.capsules.a, arm.capsules.b]).to(q)
    links = torch.cat([arm.capsules.link, arm.capsules.link]).tolist()
    placed = place_points(arm, q, points, links)
    count = len(arm.capsules.radius)
    return placed[:, :count], placed[:, count:]


def place_points(arm: Arm, q: Tensor, points: Tensor, links: list[int]) -> Tensor:
    """World positions [m], (3, K, N), of points (K, 3) fixed to links (-1: the base)."""
    if not links:
        return q.new_zeros(3, 0, q.shape[1])
    frames = _frames(arm, q)
    placed = [add(frames[link + 1][1], to_parent(frames[link + 1][0], x)) for link, x in zip(links, points)]
    return torch.stack([torch.stack(x) for x in placed], 1)


def frames_of(arm: Arm, q: Tensor) -> tuple[Tensor, Tensor]:
    """Rotations (J + 1, N, 3, 3) and origins [m], (J + 1, N, 3), of the base and the joints, at (J, N)."""
    turns, origins = zip(*_frames(arm, q))
    stacked = torch.stack([torch.stack([torch.stack(row) for row in turn]) for turn in turns])
    return stacked.permute(0, 3, 1, 2), torch.stack([torch.stack(x) for x in origins]).permute(0, 2, 1)


def _frames(arm: Arm, q: Tensor) -> list[tuple[Matrix, Vector]]:
    """Frames of the base and the joints in the world, at joint positions (J, N)."""
    chain, zero = Chain.of(arm), torch.zeros_like(q[0])
    one = zero + 1
    turn: Matrix = ((one, zero, zero), (zero, one, zero), (zero, zero, one))
    origin: Vector = (zero, zero, zero)
    frames = [(turn, origin)]
    for i in range(arm.joints):
        local, shift = placement(chain, i, q[i])
        origin, turn = add(origin, to_parent(turn, shift)), product(turn, local)
        frames.append((turn, origin))
    return frames


def segment_distance(a1: Tensor, b1: Tensor, a2: Tensor, b2: Tensor) -> Tensor:
    """Distance [m], (…), between segments with end points (3, …).

    The nearest points are found without gradient and the distance taken between them: by the
    envelope theorem its gradient is exact. Good to 1e-7 of a length in the worst case, two segments
    that nearly coincide.
    """
    one, two = nearest_on_segments(a1, b1, a2, b2)
    gap = one - two
    return (gap * gap).sum(0).clamp_min(_TOUCHING**2).sqrt()


def nearest_on_segments(a1: Tensor, b1: Tensor, a2: Tensor, b2: Tensor) -> tuple[Tensor, Tensor]:
    """The nearest points [m], (3, …) each, of segments with end points (3, …).

    Source: Ericson 2005, section 5.1.9.
    """
    with torch.no_grad():
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
