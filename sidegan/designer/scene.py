"""A situation as numbers, made within a fraction of a millisecond from what is known of the arm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch

from sidegan.designer.situation import Situation
from sidegan.errors import InfeasibleError
from sidegan.kernels.chain import CONVEX, Shapes
from sidegan.motion.arrays import array, shapes_of
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER, Arm
from sidegan.validity import Constraints, Region
from sidegan.validity.bounds import capsule_reach
from sidegan.validity.constraints import random_axes
from sidegan.validity.pairs import Pairs
from sidegan.validity.regions import tables

Array = np.ndarray

_LEAST_ROOM = 1e-3  # [rad or m] to a limit: a joint that rests at one can hardly move
_KEPT = 16  # clearances for which it is known what is checked
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
    clearance: float  # that is kept, the larger one of the workspace's and the situation's [m]
    shapes: Shapes  # grown by the clearance, links and regions together
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
        self.higher = {HIGHER[name]: array(limit) for name, limit in constraints.higher.items()}
        orders = range(2, max([1, *self.higher]) + 1)
        free = np.full(arm.joints, np.inf)
        self.limits = np.array([self.higher.get(order, free) for order in orders]).reshape(-1, arm.joints)
        self.peaks = self.basis(_PEAKS, max([2, *(order + 1 for order in self.higher)]))
        self._keeping = {constraints.clearance: constraints}
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

    def keeping(self, clearance: float) -> Constraints:
        """The arm in its workspace, from which it keeps clear by so much [m].

        Raises:
            InfeasibleError: when it cannot.
        """
        if clearance not in self._keeping:
            if len(self._keeping) >= _KEPT:
                self._keeping = {self.constraints.clearance: self.constraints}
            self._keeping[clearance] = self._keep(clearance)
        return self._keeping[clearance]

    def _keep(self, clearance: float) -> Constraints:
        own = self.constraints  # whose links may have less room between them than it has elsewhere
        apart = clearance if own.apart == own.clearance else own.apart
        if self.same_pairs and not own.lowered:
            return _Found(self.arm, own.regions, own, own.guarded, clearance, apart)
        refused = f"a clearance of {clearance:g} m cannot be kept"
        try:
            found = Constraints(self.arm, own.regions, own.torque, clearance, apart)
        except InfeasibleError as error:
            raise InfeasibleError(f"{refused}: {error}") from error
        if found.lowered:  # somebody asked for it: no link has less without a word
            raise InfeasibleError(f"{refused}: {found.kept_clear}")
        return found

    @property
    def same_pairs(self) -> bool:
        """Whether the same pairs are kept apart whatever the clearance: none provably never touches."""
        return self.arm.capsules.pieces is None

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
            InfeasibleError: for a region that no link can leave, or a clearance that cannot be kept.
        """
        home = situation.home_of(self.arm.joints, self.trajectory.home or ())
        period = situation.period or self.trajectory.period
        speed = self.speed * situation.velocity
        room = (self.upper - self.lower) / 2
        size = (self._square * (period / room[:, None]) ** 2 + 1 / speed[:, None] ** 2) ** -0.5
        clearance = max(situation.clearance, self.constraints.clearance)
        shapes, excepted = self._shapes(situation.regions, clearance)
        above, below = np.maximum(self.upper - home, _LEAST_ROOM), np.maximum(home - self.lower, _LEAST_ROOM)
        torque = self.torque * situation.torque
        return Scene(situation, home, period, above, below, speed, torque, clearance, shapes, size, excepted)

    def _shapes(self, regions: Sequence[Region], clearance: float) -> tuple[Shapes, tuple[str, ...]]:
        """Capsules and regions, and which links can leave none of the latter."""
        own = self.keeping(clearance)
        base, excepted = own.shapes, list(own.excepted.get("keep_out", ()))
        if regions:
            first, names = len(base.regions), self.arm.capsules.names
            leaves = self._leaving(regions)
            for r, row in enumerate(leaves):
                if not row.any():
                    raise InfeasibleError(f"no link is ever outside of {regions[r]}")
                excepted += [f"{names[self.moving[k]]} in region {first + r}" for k in np.nonzero(~row)[0]]
            which, inner = np.nonzero(leaves)
            guarded = np.concatenate([base.guarded, np.stack([first + which, self.moving[inner]], 1)])
            base = _with_regions(base, own.grown(regions))
            base = base._replace(guarded=np.ascontiguousarray(guarded))
        return base, tuple(excepted)

    def _leaving(self, regions: Sequence[Region]) -> Array:
        """Whether moving capsules are outside of regions in any configuration, (R, C)."""
        from sidegan.kernels.guards import leaving

        return leaving(_with_regions(self._bare, regions), self.moving, self.ends)

    @cached_property
    def _bare(self) -> Shapes:
        """The arm's capsules as they are, without anything that they keep away from."""
        none = torch.zeros(0, 2, dtype=torch.long)
        return shapes_of(self.arm.capsules, none, none, tables(()))

    def among(self, scene: Scene) -> Constraints:
        """The same scene as every other room knows it."""
        speed, torque = torch.from_numpy(scene.speed), torch.from_numpy(scene.torque)
        arm = replace(self.arm, velocity_limit=speed, torque_limit=torque)
        known, guarded = self.keeping(scene.clearance), torch.from_numpy(scene.shapes.guarded)
        regions = [*known.regions, *known.lowered, *scene.situation.regions]
        return _Found(arm, regions, known, guarded, known.clearance, known.apart)

    def family(self, scene: Scene) -> Trajectory:
        """The family of the scene's trajectories."""
        return replace(self.trajectory, period=scene.period, home=scene.home.tolist())

    def points(self, scene: Scene, c: Array) -> Array:
        """Points in natural coordinates, (J, K), of coefficients (J, K)."""
        return c @ self.unturn.T / scene.size

    def start(self, scene: Scene, random: np.random.Generator, reach: float) -> Array:
        """A random point (J, K), each joint using ``reach`` of its tightest limit."""
        x = random.standard_normal(scene.size.shape)
        return x * (reach / self.use(scene, (x * scene.size) @ self.turn.T))[:, None]

    def use(self, scene: Scene, c: Array) -> Array:
        """Largest share of its position or velocity limit, or of higher ones, that each joint uses, (…, J).

        Coefficients are (…, J, K) [rad/s].
        """
        position, velocity = c @ self.peaks[0] * scene.period, np.abs(c @ self.peaks[1]).max(-1)
        away = np.maximum(position.max(-1) / scene.above, -position.min(-1) / scene.below)
        use = np.maximum(np.maximum(away, velocity / scene.speed), 1e-9)
        for order, limit in self.higher.items():
            peak = np.abs(c @ self.peaks[order]).max(-1) * scene.period ** (1 - order)
            use = np.maximum(use, peak / limit)
        return use

    def within(self, scene: Scene, c: Array, share: float) -> Array:
        """Coefficients, (…, J, K), of which no joint uses more than a share of its limits."""
        return c / np.maximum(self.use(scene, c) / share, 1.0)[..., None]


class _Found(Constraints):
    """Constraints of which it is known what is checked: the pairs of others, and what is guarded."""

    def __init__(
        self,
        arm: Arm,
        regions: Sequence[Region],
        known: Constraints,
        guarded: torch.Tensor,
        clearance: float,
        apart: float,
    ) -> None:
        self._known, self._found = known, guarded
        super().__init__(arm, regions, known.torque, clearance, apart)
        self.excepted |= known.excepted

    def _pairs(self) -> Pairs:
        return self._known._pairs()

    def _find_guarded(self) -> torch.Tensor:
        return self._found


def _with_regions(shapes: Shapes, regions: Sequence[Region]) -> Shapes:
    """Shapes with more regions, after those that there are."""
    numbers, kinds, planes = map(array, tables(regions))
    numbers[kinds == CONVEX, 4:] += len(shapes.planes)
    return shapes._replace(
        regions=np.concatenate([shapes.regions, numbers]),
        kinds=np.concatenate([shapes.kinds, kinds]),
        planes=np.concatenate([shapes.planes, planes]),
    )
