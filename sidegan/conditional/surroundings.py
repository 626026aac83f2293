"""How far an arm is from what surrounds it, where the surroundings differ between trajectories."""

import math
from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from sidegan.conditional.condition import Condition
from sidegan.errors import InfeasibleError
from sidegan.validity import Box, Constraints
from sidegan.validity.capsules import capsule_axes

_SAMPLES = 4_000  # random configurations that decide what a link can stay out of
_CORNER = math.sqrt(3)  # of the unit cube, from its centre
_CUBE = Box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


class Surroundings:
    """Distances of an arm's moving capsules from planes, walls and obstacles, differentiable."""

    def __init__(self, constraints: Constraints) -> None:
        self.constraints, self.arm = constraints, constraints.arm
        self.moving = torch.nonzero(self.arm.capsules.link >= 0)[:, 0]
        random = torch.Generator().manual_seed(0)
        draw = torch.rand(self.arm.joints, _SAMPLES, generator=random, dtype=torch.float64)
        low, high = self.arm.position_lower[:, None], self.arm.position_upper[:, None]
        self._ends = self._capsules(torch.lerp(low, high, draw))  # of the moving capsules
        radius = self.arm.capsules.radius[self.moving]
        self.radius = radius + constraints.clearance
        a, b = self._ends
        self.highest = (torch.minimum(a[2], b[2]) - radius[:, None]).amax(1)

    def _capsules(self, q: Tensor) -> tuple[Tensor, Tensor]:
        a, b = capsule_axes(self.arm, q)
        return a[:, self.moving], b[:, self.moving]

    def clearances(self, q: Tensor, condition: Condition, reach: float = math.inf) -> dict[str, Tensor]:
        """Signed distances [m], (B, T, K), at positions (B, T, J), of what the conditions request at all.

        A link that no configuration brings above a plane is excepted from it, as in ``Constraints``. What is
        farther from an obstacle than ``reach`` may be given as infinite, which is faster.
        """
        count, times, joints = q.shape
        requested = {
            "plane": condition.plane > -math.inf,
            "walls": condition.walls < math.inf,
            "obstacle": condition.obstacle[:, 3] > 0,
        }
        kinds = [kind for kind, rows in requested.items() if rows.any()]
        if not kinds:
            return {}
        a, b = self._capsules(q.reshape(-1, joints).T.contiguous())
        a, b = (x.unflatten(2, (count, times)) for x in (a, b))  # (3, C, B, T)
        distances: dict[str, Callable[[Tensor, Tensor, Condition], Tensor]] = {
            "plane": self._plane,
            "walls": self._walls,
            "obstacle": partial(self._obstacle, reach=reach),
        }
        return {kind: distances[kind](a, b, condition).permute(1, 2, 0) for kind in kinds}

    def _plane(self, a: Tensor, b: Tensor, condition: Condition) -> Tensor:
        height = torch.minimum(a[2], b[2]) - self.radius[:, None, None] - condition.plane[:, None]
        excepted = self.highest[:, None, None] <= condition.plane[:, None]
        return torch.where(excepted, math.inf, height)

    def _walls(self, a: Tensor, b: Tensor, condition: Condition) -> Tensor:
        far = torch.maximum(a[:2].abs(), b[:2].abs()) + self.radius[:, None, None]
        return (condition.walls.T[:, None, :, None] - far).flatten(0, 1)

    def _obstacle(self, a: Tensor, b: Tensor, condition: Condition, reach: float) -> Tensor:
        """The distance from a cube grows with it: that from the unit cube, of everything in half edges."""
        centre, half = (x.T[:, None, :, None] for x in condition.obstacle.split([3, 1], 1))
        half, radius = half[0].expand(a.shape[1:]), self.radius[:, None, None].expand(a.shape[1:])
        with torch.no_grad():  # spheres around both
            apart = ((a + b) / 2 - centre).norm(dim=0) - (b - a).norm(dim=0) / 2 - _CORNER * half - radius
        near = (half > 0) & (apart < reach)
        unit = half[near]
        ends = ((x - centre)[:, near] / unit for x in (a, b))
        distance = unit * _CUBE.margin(*ends) - radius[near]
        return torch.full_like(a[0], math.inf).index_put(near.nonzero(as_tuple=True), distance)

    def refuse(self, condition: Condition) -> None:
        """Refuse regions that an arm cannot live in, of a batch of one.

        Raises:
            InfeasibleError: names a link that can never be between the walls or out of the obstacle, or not
                above the plane though it can stay out of the workspace's own regions.
        """
        names = [self.arm.capsules.names[k] for k in self.moving.tolist()]
        own = {int(k) for k in self.constraints.guarded[:, 1]}
        a, b = (x[:, :, None] for x in self._ends)  # (3, C, 1, N)
        for k in _never_clear(self._walls(a, b, condition)):
            raise InfeasibleError(f"walls leave no room: {names[k % len(names)]} is never clear of them")
        for k in _never_clear(self._obstacle(a, b, condition, math.inf)):
            raise InfeasibleError(f"the obstacle encloses the arm: {names[k]} is never clear of it")
        height = float(condition.plane[0])
        for k in torch.nonzero(self.highest <= height)[:, 0].tolist():
            if int(self.moving[k]) in own or not self.constraints.regions:
                raise InfeasibleError(f"plane at {height:.4g} m leaves no room: {names[k]} is never above it")


def _never_clear(distance: Tensor) -> list[int]:
    """Rows of distances (K, 1, N) that are nowhere positive."""
    return torch.nonzero((distance <= 0).all(2).all(1))[:, 0].tolist()
