"""Constraints of an arm in its workspace, as signed margins of single states."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted, listed
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.kernels.chain import Bodies, Shapes
from sidegan.motion.arrays import kernel_shapes
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import DERIVATIVE_ORDER, Arm
from sidegan.validity.capsules import bodies_of, capsule_clearances, piece_distances, thicker
from sidegan.validity.pairs import (
    CONFIGURATIONS,
    Links,
    Pairs,
    links_of,
    pairs_of,
    random_configurations,
    too_large,
    usual_gaps,
)
from sidegan.validity.regions import Obstacle, Plane, tables

# In the order of the kernels.
CONSTRAINTS = ("position", "velocity", "torque", "collision", "keep_out", *DERIVATIVE_ORDER)
DISTANCES = CONSTRAINTS[3:5]
_SHOWN = 4  # exceptions named in a message
_FAR = 0.05  # [m] between capsules, above which the pieces inside are not needed


class Constraints:
    """Limits, self-collision and keep-out regions of an arm.

    Neighbouring links are not checked against each other, nor are pairs of links that the user or the
    description exempts or that provably cannot touch; see ``pairs_of``. Links inside a region in all of
    4,000 random configurations are not checked against it; ``described`` names them.

    Args:
        arm: the arm.
        regions: keep-out regions in world coordinates; messages count them from 0.
        torque: whether torque limits count, if there are any.
        clearance: distance that links keep from the regions [m]; margins of distances are in excess of it.
            At edges of boxes slightly more is kept. Links that are always closer to a plane (those above
            the foot of the arm) only keep out of it, as ``kept_clear`` says.
        apart: distance that links keep from each other [m]; the clearance if None.
        tight: smaller distances [m] for pairs of links that have less room.

    Raises:
        InfeasibleError: when links that are not exempt always touch, no link ever leaves a region, or links
            are always closer than the clearance.
    """

    def __init__(
        self,
        arm: Arm,
        regions: Sequence[Obstacle] = (),
        torque: bool = True,
        clearance: float = 0.0,
        apart: float | None = None,
        tight: Mapping[Links, float] | None = None,
    ) -> None:
        self.arm, self.clearance = arm, clearance
        self.apart = clearance if apart is None else apart
        self.tight = {links: gap for links, gap in (tight or {}).items() if gap < self.apart}
        self._thick = thicker(arm, self.apart)
        self.body = RigidBody(arm)
        self.regions = tuple(regions)
        # Planes come twice, the second time without clearance, for links that are always closer.
        planes = [r for r, region in enumerate(regions) if isinstance(region, Plane)]
        self._region_of = [*range(len(regions)), *planes]
        obstacles = (*regions, *(regions[r].grown(-clearance) for r in planes))
        # Capsules are inflated for regions, too, but no region is shrunk: its corners would come too close.
        inflated = min(clearance, self.apart / 2)
        self._outer = arm.capsules.radius + inflated
        rest = clearance - inflated
        self._grown = [region.grown(rest) if rest else region for region in obstacles]
        heavy = bool(arm.inertial_parameters.any())  # otherwise torques are unknown
        self.torque = torque and heavy and bool(np.isfinite(arm.torque_limit).any())
        self.higher = arm.higher_limits  # on acceleration and jerk, (J,), if there are any
        self.link_pairs = self._pairs()  # checked or exempt
        self.pairs = self.link_pairs.checked  # of capsules, (P, 2)
        owners = arm.capsules.owners
        self.owners = [links_of(owners[i], owners[j]) for i, j in self.pairs.tolist()]  # links of these pairs
        gaps = [self.tight.get(links, self.apart) for links in self.owners]
        self.gaps = np.array(gaps, float)  # distances that these pairs keep [m], (P,)
        self.never_out: tuple[str, ...] = ()  # capsules that never leave a region, with the region
        self.guarded = self._find_guarded()  # region and capsule index of each keep-out check, (K, 2)
        limited = ["position", "velocity", *self.higher, *(["torque"] if self.torque else [])]
        # names of the elements of each constraint's margins
        self.labels: dict[str, tuple[str, ...]] = dict.fromkeys(limited, arm.joint_names)
        if len(self.pairs):
            self.labels["collision"] = tuple(" – ".join(links) for links in self.owners)
        if len(self.guarded):
            self.labels["keep_out"] = self._guarded_names(self.guarded)

    @property
    def orders(self) -> int:
        """Number of arrays in a state: 3, or 4 if jerk is limited."""
        return 4 if "jerk" in self.higher else 3

    @property
    def higher_rows(self) -> Array:
        """Limits on acceleration and jerk for kernels, (2, J), or (2, 0) if there are none."""
        none = np.full_like(self.arm.velocity_limit, np.inf)
        rows = [self.higher.get(name, none) for name in DERIVATIVE_ORDER]
        return np.stack(rows) if self.higher else np.zeros((len(DERIVATIVE_ORDER), 0))

    def margins(self, *states: Array) -> dict[str, Array]:
        """Signed margins by constraint, (N, K) each [rad, rad/s, rad/s², rad/s³, N·m, m], of states (N, J).

        Nonnegative margins are feasible. States are position, velocity, acceleration, and jerk if limited.

        Raises:
            ShapeError: when the states are not (N, J) each, or jerk is limited and not given.
        """
        arm = self.arm
        if len(states) < self.orders or {x.shape for x in states} != {(len(states[0]), arm.joints)}:
            shapes = ", ".join(str(x.shape) for x in states)
            raise ShapeError(f"states are {shapes}, expected {self.orders} times (N, {arm.joints})")
        q, dq, ddq, *_ = states
        margins = {
            "position": np.minimum(q - arm.position_lower, arm.position_upper - q),
            "velocity": arm.velocity_limit - np.abs(dq),
            **{name: x - np.abs(states[DERIVATIVE_ORDER[name]]) for name, x in self.higher.items()},
        }
        if self.torque:
            drives = arm.known_drives  # Coulomb friction may have either sign at low speed
            torque = self.body.torque(q, dq, ddq) + drives.smooth(dq, ddq)
            margins["torque"] = arm.torque_limit - drives.coulomb - np.abs(torque)
        return margins | {name: x for name, x in self._distances(q).items() if name in self.labels}

    def at_rest(self, q: Array) -> dict[str, Array]:
        """Margins at rest at positions (N, J)."""
        still = np.zeros_like(q)
        return self.margins(q, still, still, still)

    def relative(self, margins: dict[str, Array], distance: float) -> dict[str, Array]:
        """Margins relative to half the range, the limit, or ``distance`` [m]; 1 where there is no limit."""
        arm = self.arm
        whole = {
            "position": (arm.position_upper - arm.position_lower) / 2,
            "velocity": arm.velocity_limit,
            **self.higher,
            "torque": np.maximum(arm.torque_limit - arm.known_drives.coulomb, np.finfo(float).tiny),
        }
        scales = {name: np.asarray(whole.get(name, distance)) for name in margins}
        with np.errstate(over="ignore", invalid="ignore"):  # infinite limits, friction up to the limit
            return {name: np.where(np.isfinite(x), margins[name] / x, 1.0) for name, x in scales.items()}

    def _distances(self, q: Array) -> dict[str, Array]:
        """Margins of distances, by the pieces inside capsules where these are close."""
        collision, keep_out = capsule_clearances(self.bodies.chain, self.bodies.shapes, q)
        near = np.argwhere((collision < _FAR) & self.bodies.hulls.finer)
        n, p = near.T
        collision[n, p] = np.maximum(collision[n, p], piece_distances(self.bodies, q, near))
        return dict(zip(DISTANCES, (collision, keep_out)))

    @cached_property
    def bodies(self) -> Bodies:
        """Capsules, the pieces inside them and regions for compiled kernels."""
        return bodies_of(self._thick, self._shapes_of(self.pairs, self.guarded))

    def _shapes_of(self, pairs: Array, guarded: Array) -> Shapes:
        closer = self.apart - self.gaps if len(pairs) else None
        return kernel_shapes(self._thick.capsules, pairs, guarded, tables(self._grown), closer, self._outer)

    def described(self) -> str:
        """What is checked and what is not, in one line for people."""
        arm, capsules, pairs = self.arm, self.arm.capsules, self.link_pairs
        limited = {name: int(np.isfinite(limit).sum()) for name, limit in self.higher.items()}
        limited["torque"] = int(np.isfinite(arm.torque_limit).sum()) if self.torque else 0
        limits = ", ".join(f"{name} of {count}" for name, count in limited.items())
        apart = len(set(self.owners))
        links = f"{apart} of {counted(apart + len(pairs.named), 'pair')} of links"
        named = [
            f"{' – '.join(links)} ({why}, touch in {100 * share:.3g} %)"
            for links, (why, share) in pairs.named.items()
        ]
        links += _except(named, "may touch")
        links += f"; {len(pairs.never)} never touch" if pairs.never else ""
        noun = "joint origin" if capsules.only_points else "link"
        guarded = {*self._guarded_names(self.guarded)}
        both = f"{counted(len(guarded.union(self.never_out)), 'pair')} of {noun}s and regions"
        if origins := 0 if capsules.only_points else int((~capsules.shaped[self.guarded[:, 1]]).sum()):
            both += f" ({counted(origins, 'joint origin')})"
        regions = f"{len(guarded)} of {both}" + _except(self.never_out, "always inside")
        found = [f"position and velocity of {counted(arm.joints, 'joint')}, {limits}", links, regions]
        if self.clearance:
            found.append(f"{self.kept_clear} kept clear")
        shaped = set(capsules.link[capsules.shaped & (capsules.link >= 0)].tolist())
        if bare := arm.joints - len(shaped):
            found.append(f"not checked: {counted(bare, 'link')} without a shape")
        return "; ".join(found)

    @property
    def kept_clear(self) -> str:
        """Distances that are kept, in words for people."""
        links = f" from regions and {self.apart:g} m between links" if self.apart != self.clearance else ""
        near = _except(self._guarded_names(self.guarded[~self._whole]), "always closer")
        less = [f"{' – '.join(pair)} {gap:g} m" for pair, gap in self.tight.items() if pair in self.owners]
        return f"{self.clearance:g} m{links}{near}{_except(less, 'less room')}"

    def nearest(self, q: Array) -> tuple[Array, Array]:
        """Smallest distance [m] of links from each other and from regions, and its index, (N,), at (N, J).

        Indices count through the labels of all ``DISTANCES``. Above some centimetres distances are lower
        bounds, infinite if nothing is near. Links that are always too close to a plane are left out, and
        so are joint origins, which stand for links without shapes.
        """
        far = np.full((len(q), 1), np.inf)
        shown = self._whole & self.arm.capsules.shaped[self.guarded[:, 1]]
        kept = self.kept | {"keep_out": np.where(shown, self.clearance, np.inf)}
        near = [margin + kept[name] for name, margin in self._distances(q).items()]
        distances = np.concatenate([*near, far], 1)
        return distances.min(1), distances.argmin(1)

    @property
    def _whole(self) -> Array:
        """Whether each guarded capsule keeps the whole clearance, (K,)."""
        return self.guarded[:, 0] < len(self.regions)

    @property
    def kept(self) -> dict[str, Array]:
        """Distances [m] kept by pairs, (P,), and guarded capsules, (K,)."""
        return {"collision": self.gaps, "keep_out": self.clearance * self._whole}

    def keeps_out(self, home: Sequence[float], spare: float) -> bool:
        """Whether home (J,) [rad or m] leaves the share ``spare`` of each distance from regions to spare."""
        left = self._distances(np.array([home], float))["keep_out"]
        return bool((left >= spare * self.kept["keep_out"]).all())

    def distances_at(self, q: Array) -> dict[Links, float]:
        """Distances [m] of all checked pairs of links at a position (J,)."""
        found: dict[Links, float] = {}
        left = self._distances(q[None])["collision"][0] + self.gaps
        for links, distance in zip(self.owners, left.tolist()):
            found[links] = min(found.get(links, distance), distance)
        return found

    def refuse_home(self, home: Sequence[float]) -> None:
        """Refuse a home position at which the arm cannot rest.

        Raises:
            ShapeError: when it is not one finite number per joint.
            InfeasibleError: when it is infeasible; names violated limits, pairs and regions, with margins.
        """
        q = np.array([home], float)
        if q.shape[1] != self.arm.joints or not np.isfinite(q).all():
            raise ShapeError(f"home position {list(home)} must be {self.arm.joints} finite joint positions")
        faults: dict[str, float] = {}  # worst margin by name, which several parts of a link may share
        for name, margin in self.at_rest(q).items():
            for k in np.flatnonzero(margin[0] < 0).tolist():
                which = f"{name} of {self.labels[name][k]}"
                faults[which] = min(faults.get(which, 0.0), float(margin[0, k]))
        if faults:
            reasons = "; ".join(f"{which}: margin {margin:.4g}" for which, margin in faults.items())
            raise InfeasibleError(f"home position {list(home)} is not feasible: {reasons}")

    def _find_guarded(self) -> Array:
        """Regions and capsules to check, (K, 2), in the order of regions; raises if that is impossible."""
        moving = np.flatnonzero(self.arm.capsules.link >= 0)
        both = np.stack(np.meshgrid(np.arange(len(self.regions)), moving, indexing="ij"), -1).reshape(-1, 2)
        if not len(both):
            return both
        shapes = self._shapes_of(both[:0], both)
        _, distances = capsule_clearances(self.body.chain, shapes, random_configurations(self.arm))
        farthest = distances.max(0).reshape(-1, len(moving))
        leaves = farthest + self.clearance > 0
        stuck = np.flatnonzero(~leaves.any(1))
        if len(stuck):
            raise InfeasibleError(
                f"region {int(stuck[0])} cannot be avoided: no link is outside it in any of "
                f"{CONFIGURATIONS:,} random configurations"
            )
        self.never_out = self._guarded_names(both[~leaves.ravel()])
        short = leaves & (farthest <= 0)
        planes = self._region_of[len(self.regions) :]
        kept = np.concatenate([leaves & ~short, short[planes]])
        short[planes] = False
        if short.any():
            names = self._guarded_names(both[short.ravel()])
            raise too_large(self.clearance, names, float(farthest[short].min()))
        which, capsule = np.nonzero(kept)
        return np.stack([which, moving[capsule]], 1)

    def _pairs(self) -> Pairs:
        """The pairs to check, with the clearance."""
        try:
            return pairs_of(self._thick, frozenset(self.tight))
        except InfeasibleError:
            pairs_of(self.arm)  # raises its own error for links that touch without any clearance
            near = usual_gaps(self._thick)
            names = [" – ".join(links) for links in near]
            raise too_large(self.apart, names, min(near.values(), default=-np.inf)) from None

    def _guarded_names(self, guarded: Array) -> tuple[str, ...]:
        owners = self.arm.capsules.owners
        return tuple(f"{owners[k]} in region {self._region_of[r]}" for r, k in guarded.tolist())


def _except(names: Sequence[str], why: str) -> str:
    """The first of some names, and why they are exceptions, in parentheses."""
    return f" ({why}: {listed(list(dict.fromkeys(names)), _SHOWN)})" if names else ""
