"""How near bodies may come, to each other or to a region, in a cell: the reference of the kernel.

Along one direction both bodies lie in intervals, whose ends move evenly but for how their points' paths bend.
Any direction gives a bound; that of the line between the nearest points gives a close one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from sidegan.robot import Arm
from sidegan.validity.bounds import CellMotion, Slack
from sidegan.validity.capsules import frames_of, nearest_on_segments
from sidegan.validity.pieces import PieceDistances
from sidegan.validity.regions import Region

_NO_DIRECTION = 1e-12  # [m²] between nearest points that are one


@dataclass(frozen=True)
class Moving:
    """Pairs of an arm's capsules at the centres of cells.

    Attributes:
        pieces: what is inside of the pairs.
        slack: bounds of how their distances change.
        q: positions at the centres, (N, J).
        dq: velocities there, (N, J).
        motion: bounds over the cells.
        half: half width of the cells [s].
    """

    pieces: PieceDistances
    slack: Slack
    q: Tensor
    dq: Tensor
    motion: CellMotion
    half: float

    def capsules(self, asked: Tensor) -> Tensor:
        """Least distances [m], (M,), in a cell, of the capsules of pairs; asked are cell and pair, (M, 2)."""
        n, inner, outer = self._bodies(asked)
        one, other = (self._placed(c, n) for c in (inner, outer))
        a, b = nearest_on_segments(*one, *other)
        gap, middles = (b - a).T, (other[0] + other[1] - one[0] - one[1]).T
        upwards = torch.tensor([0.0, 0.0, 1.0]).to(gap).expand_as(gap)
        for fallback in (middles, upwards):
            gap = torch.where(((gap * gap).sum(1) > _NO_DIRECTION)[:, None], gap, fallback)
        points = torch.stack([self.arm.capsules.a, self.arm.capsules.b], 1)
        least = self._least(asked, gap, [*points], self.arm.capsules.radius)
        n, p = asked.unbind(1)
        return least - self._bend(self.slack.pair_reach[p], self.slack.between[p], n)

    def inside(self, asked: Tensor) -> Tensor:
        """The same of what is inside of the capsules; minus infinity where that touches."""
        pieces = self.arm.capsules.pieces
        assert pieces is not None
        _, inner, _ = self._bodies(asked)
        points = self.pieces.nearest(self.q, asked)
        gap = points[:, 1] - points[:, 0]
        gap = torch.where((inner == self.pieces.pairs[asked[:, 1], 0])[:, None], gap, -gap)
        corners = [*pieces.corners.split(pieces.start.diff().tolist())]
        n, p = asked.unbind(1)
        bend = self._bend(self.slack.piece_reach[p], self.slack.between[p], n)
        return (self._least(asked, gap, corners, pieces.radius) - bend).nan_to_num(-torch.inf)

    def regions(self, kept_out: Sequence[Region], guarded: Tensor, asked: Tensor) -> Tensor:
        """Least margins [m], (M,), in a cell, of capsules that are off regions.

        Args:
            kept_out: the regions.
            guarded: region and capsule, (K, 2).
            asked: cell and row of these, (M, 2).
        """
        n, g = asked.unbind(1)
        region, capsule = guarded[g].unbind(1)
        a, b = self._placed(capsule, n)
        margin, point, away = torch.zeros_like(a[0]), torch.zeros_like(a), torch.zeros_like(a)
        for r in torch.unique(region).tolist():
            mine = region == r
            margin[mine], point[:, mine], away[:, mine] = _nearest(kept_out[r], a[:, mine], b[:, mine])
        turning, moving = (x.T for x in self._twists[:, self.arm.capsules.link[capsule] + 1, n])
        low = []
        for end in (a, b):
            rate = (away * (moving + torch.linalg.cross(turning, end, dim=0))).sum(0)
            low.append((away * (end - point)).sum(0) - self.half * rate.abs())
        least = margin + torch.minimum(*low) - self.arm.capsules.radius[capsule].to(a)
        reach = self.slack.region_reach[g]
        return least - self._bend(reach, torch.ones_like(reach, dtype=torch.bool), n)

    @property
    def arm(self) -> Arm:
        """Whose pairs they are."""
        return self.pieces.arm

    @cached_property
    def _frames(self) -> tuple[Tensor, Tensor]:
        return frames_of(self.arm, self.q.T.contiguous())

    @cached_property
    def _twists(self) -> Tensor:
        """Angular velocities of the frames, and velocities at the origin, (2, J + 1, N, 3)."""
        turns, places = self._frames
        slides = self.arm.prismatic[:, None, None]
        axes = torch.einsum("jnab,jb->jna", turns[1:], self.arm.axis.to(self.q)) * self.dq.T[..., None]
        turning = torch.where(slides, 0.0, axes)
        moving = torch.where(slides, axes, torch.linalg.cross(places[1:], axes))
        steps = torch.stack([turning, moving]).cumsum(1)
        return torch.cat([torch.zeros_like(steps[:, :1]), steps], 1)

    def _bodies(self, asked: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        n, p = asked.unbind(1)
        first, second = self.pieces.pairs[p].unbind(1)
        link = self.arm.capsules.link
        swapped = link[first] > link[second]
        return n, torch.where(swapped, second, first), torch.where(swapped, first, second)

    def _placed(self, c: Tensor, n: Tensor) -> tuple[Tensor, Tensor]:
        """Ends of capsules' axes, (3, M) each."""
        turns, places = self._frames
        frame, capsules = self.arm.capsules.link[c] + 1, self.arm.capsules
        a, b = (
            torch.einsum("mij,mj->im", turns[frame, n], x[c].to(self.q)) for x in (capsules.a, capsules.b)
        )
        return a + places[frame, n].T, b + places[frame, n].T

    def _least(self, asked: Tensor, gap: Tensor, corners: list[Tensor], radius: Tensor) -> Tensor:
        """Least gaps along directions (M, 3) from inner to outer bodies if points moved evenly, (M,)."""
        n, inner, outer = self._bodies(asked)
        normal = gap / gap.norm(dim=1, keepdim=True)
        frames = [self.arm.capsules.link[c] + 1 for c in (inner, outer)]
        turning, moving = self._twists[:, frames[1], n] - self._twists[:, frames[0], n]
        turned, rate = torch.linalg.cross(normal, turning), (normal * moving).sum(1)
        low = [
            time * rate - self._height(outer, n, -(normal + time * turned), corners)
            for time in (self.half, -self.half)
        ]
        round_ = (radius[inner] + radius[outer]).to(gap)
        return torch.minimum(*low) - self._height(inner, n, normal, corners) - round_

    def _height(self, c: Tensor, n: Tensor, direction: Tensor, corners: list[Tensor]) -> Tensor:
        """How far bodies reach in directions (M, 3), (M,)."""
        turns, places = self._frames
        frame = self.arm.capsules.link[c] + 1
        local = torch.einsum("mji,mj->mi", turns[frame, n], direction)
        height = (direction * places[frame, n]).sum(1)
        for body in torch.unique(c).tolist():
            mine = c == body
            height[mine] += (local[mine] @ corners[body].to(local).T).amax(1)
        return height

    def _bend(self, reach: Tensor, between: Tensor, n: Tensor) -> Tensor:
        """How far at most a point of the outer body leaves its even motion, (M,).

        By joints' accelerations at their largest levers, (M, J), and products of speeds at that of the outer
        one, of the joints between the bodies.
        """
        speed = self.motion.speed[n] * between
        before = speed.cumsum(1) - speed
        terms = self.motion.acceleration[n] + speed * (speed + 2 * before)
        return self.half**2 / 2 * (reach.to(speed) * between * terms).sum(1)


def _nearest(region: Region, a: Tensor, b: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Distances [m] of segments with ends (3, M), their nearest points, and unit directions away."""
    with torch.enable_grad():
        ends = [x.detach().requires_grad_(True) for x in (a, b)]
        distance = region.margin(*ends)
        slopes = torch.autograd.grad(distance.sum(), ends)
    away = slopes[0] + slopes[1]
    share = (slopes[1] * away).sum(0) / (away * away).sum(0)
    return distance.detach(), torch.lerp(a, b, share), away
