"""A situation as numbers, made within a fraction of a millisecond from what is known of the arm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch

from sidegan.designer.situation import Situation
from sidegan.errors import InfeasibleError
from sidegan.motion.compiled import compiled
from sidegan.motion.compiled.chain import BOX, PLANE, Shapes, array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Box, Constraints, Plane, Region
from sidegan.validity.bounds import capsule_reach
from sidegan.validity.constraints import random_axes

Array = np.ndarray

_LEAST_ROOM = 1e-3  # [rad or m] to a limit: a joint that rests at one can hardly move
_PEAKS = 240  # points of a period at which a motion's peaks are taken


@dataclass(frozen=True, eq=False)
class Scene:
    """One situation as numbers."""

    situation: Situation
    home: Array  # (J,) [rad or m]
    period: float  # [s]
    above: Array  # way from home to the upper limits, (J,) [rad or m]
    below: Array  # way from home to the lower limits, (J,) [rad or m]
    speed: Array  # velocity limits, (J,)
    torque: Array  # torque limits, (J,); infinite where nothing is limited
    shapes: Shapes  # grown by half the clearance
    size: Array  # of natural coordinates, (J, K)
    excepted: tuple[str, ...]  # links that can never leave a region


class ArmNumbers:
    """What all situations of one arm in its workspace have in common.

    Args:
        constraints: the arm in its workspace.
        trajectory: the family of trajectories, with the home and the period where no other is asked for.
    """

    def __init__(self, constraints: Constraints, trajectory: Trajectory) -> None:
        self.constraints, self.trajectory = constraints, trajectory
        arm = self.arm = constraints.arm
        self.lower, self.upper = array(arm.position_lower), array(arm.position_upper)
        self.speed, torque = array(arm.velocity_limit), array(arm.torque_limit)
        self.torque = torque if constraints.torque else np.full_like(torque, np.inf)
        self.unit = Trajectory(arm.joints, trajectory.harmonics, 1.0)
        self.peaks = self.basis(_PEAKS, 2)
        self.moving = array(arm.capsules.link >= 0).nonzero()[0]
        self.turn, self._square = self._natural()

    def basis(self, count: int, orders: int) -> Array:
        """Derivatives of the K basis functions at cell centres of a period of 1 s, (orders, K, count)."""
        grid = self.unit.grid(count)
        return np.stack([array(self.unit.basis(grid, order).flatten(1).T) for order in range(orders)])

    @staticmethod
    def stretched(basis: Array, period: float) -> Array:
        """The same for another period [s]."""
        return basis * (period ** (1.0 - np.arange(len(basis))))[:, None, None]

    def _natural(self) -> tuple[Array, Array]:
        """The metric of ``design.coordinates`` as L R (D room⁻² + speed⁻²) Rᵀ Lᵀ: (L R)⁻ᵀ, (K, K), and D."""
        basis = self.basis(20 * self.trajectory.harmonics, 2)
        position, velocity = (x @ x.T / x.shape[1] for x in basis)
        factor = np.linalg.inv(np.linalg.cholesky(velocity + np.eye(len(velocity))))
        square, turn = np.linalg.eigh(factor @ position @ factor.T)
        return np.ascontiguousarray(factor.T @ turn), square

    @cached_property
    def unturn(self) -> Array:
        """Inverse of the turn, (K, K)."""
        return np.linalg.inv(self.turn)

    @cached_property
    def reach(self) -> Array:
        """How far the motion of a joint moves a capsule, (C, J)."""
        return array(capsule_reach(self.arm))

    @cached_property
    def ends(self) -> Array:
        """Ends of the moving capsules' axes where it is decided what is guarded, (2, C, N, 3)."""
        axes = np.stack([array(x) for x in random_axes(self.arm)])
        return np.ascontiguousarray(axes[:, :, self.moving].transpose(0, 2, 3, 1))

    def scene(self, situation: Situation) -> Scene:
        """A situation as numbers.

        Raises:
            ShapeError: when home is not one finite number per joint.
            InfeasibleError: for a region that no link can leave.
        """
        home = situation.home_of(self.arm.joints, self.trajectory.home or ())
        period = situation.period or self.trajectory.period
        speed = self.speed * situation.velocity
        room = (self.upper - self.lower) / 2
        size = (self._square * (period / room[:, None]) ** 2 + 1 / speed[:, None] ** 2) ** -0.5
        shapes, excepted = self._shapes(situation)
        above, below = np.maximum(self.upper - home, _LEAST_ROOM), np.maximum(home - self.lower, _LEAST_ROOM)
        torque = self.torque * situation.torque
        return Scene(situation, home, period, above, below, speed, torque, shapes, size, excepted)

    def _shapes(self, situation: Situation) -> tuple[Shapes, tuple[str, ...]]:
        """Capsules and regions, and which links can leave none of the latter."""
        base, half = self.constraints.shapes, situation.clearance / 2
        excepted: list[str] = list(self.constraints.excepted.get("keep_out", ()))
        if situation.regions:
            numbers = np.array([region.numbers for region in situation.regions])
            kinds = np.array([PLANE if isinstance(x, Plane) else BOX for x in situation.regions])
            leaves = self._leaving(situation.regions, numbers, kinds)
            first, names = len(base.regions), self.arm.capsules.names
            for r, row in enumerate(leaves):
                if not row.any():
                    raise InfeasibleError(f"no link is ever outside of {situation.regions[r]}")
                excepted += [f"{names[self.moving[k]]} in region {first + r}" for k in np.nonzero(~row)[0]]
            which, inner = np.nonzero(leaves)
            guarded = np.concatenate([base.guarded, np.stack([first + which, self.moving[inner]], 1)])
            base = base._replace(
                guarded=np.ascontiguousarray(guarded),
                regions=np.concatenate([base.regions, numbers]),
                kinds=np.concatenate([base.kinds, kinds]),
            )
        if half > 0:
            base = _grown(base, half)
        return base, tuple(excepted)

    def _leaving(self, regions: Sequence[Region], numbers: Array, kinds: Array) -> Array:
        """Whether moving capsules are outside of regions in any configuration, (R, C)."""
        radius = array(self.arm.capsules.radius)[self.moving]
        if compiled():
            from sidegan.motion.compiled.guards import leaving

            return leaving(self.ends, radius, numbers, kinds)
        a, b = torch.from_numpy(self.ends).permute(0, 3, 1, 2)
        clear = [(region.margin(a, b) > torch.from_numpy(radius)[:, None]).any(1) for region in regions]
        return torch.stack(clear).numpy()

    def among(self, scene: Scene) -> Constraints:
        """The same scene as every other room knows it."""
        arm, half = self.arm, scene.situation.clearance / 2
        speed, torque = torch.from_numpy(scene.speed), torch.from_numpy(scene.torque)
        capsules = replace(arm.capsules, radius=arm.capsules.radius + half)
        regions = [_larger(region, half) for region in (*self.constraints.regions, *scene.situation.regions)]
        found = torch.from_numpy(scene.shapes.pairs), torch.from_numpy(scene.shapes.guarded)
        arm = replace(arm, capsules=capsules, velocity_limit=speed, torque_limit=torque)
        return _Found(arm, regions, self.constraints.torque, found)

    def family(self, scene: Scene) -> Trajectory:
        """The family of the scene's trajectories."""
        return replace(self.trajectory, period=scene.period, home=scene.home.tolist())

    def points(self, scene: Scene, c: Array) -> Array:
        """Points in natural coordinates, (J, K), of coefficients (J, K)."""
        return c @ self.unturn.T / scene.size

    def use(self, scene: Scene, c: Array) -> Array:
        """Largest share of its position or velocity limit that each joint uses, (J,)."""
        position, velocity = c @ self.peaks[0] * scene.period, np.abs(c @ self.peaks[1]).max(1)
        away = np.maximum(position.max(1) / scene.above, -position.min(1) / scene.below)
        return np.maximum(np.maximum(away, velocity / scene.speed), 1e-9)

    def within(self, scene: Scene, c: Array, share: float) -> Array:
        """Coefficients, (J, K), of which no joint uses more than a share of its limits."""
        return c / np.maximum(self.use(scene, c) / share, 1.0)[:, None]


class _Found(Constraints):
    """Constraints of which it is known what is checked."""

    def __init__(
        self, arm: Arm, regions: Sequence[Region], torque: bool, found: tuple[torch.Tensor, torch.Tensor]
    ) -> None:
        self._found = found
        super().__init__(arm, regions, torque)

    def _find_pairs(self) -> tuple[torch.Tensor, torch.Tensor]:
        return self._found


def _larger(region: Region, half: float) -> Region:
    """A region that reaches further by half a clearance."""
    if isinstance(region, Plane):
        return Plane((region.unit[0], region.unit[1], region.unit[2]), region.offset + half)
    low, high = (x - half for x in region.lower), (x + half for x in region.upper)
    return Box((next(low), next(low), next(low)), (next(high), next(high), next(high)))


def _grown(shapes: Shapes, half: float) -> Shapes:
    """Capsules and regions that are larger by half a clearance each: it is kept where they do not touch."""
    planes, regions = shapes.kinds == PLANE, shapes.regions.copy()
    regions[planes, 3] += half
    regions[~planes, 3:] += half
    return shapes._replace(radius=shapes.radius + half, size=shapes.size + half, regions=regions)
