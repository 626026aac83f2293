"""Every constraint of an arm in its workspace, as signed margins of single states."""

from collections.abc import Sequence
from functools import cached_property

import torch
from torch import Tensor

from sidegan.base.names import counted, listed
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.kernels.chain import Shapes
from sidegan.motion.arrays import shapes_of
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import HIGHER, Arm
from sidegan.validity.capsules import clearances
from sidegan.validity.clearance import thicker, too_large
from sidegan.validity.pairs import SAMPLES, Pairs, pairs_of, sampled, usual_gaps
from sidegan.validity.pieces import PieceDistances
from sidegan.validity.regions import Plane, Region, tables

# All that there are, in the order in which kernels have them.
NAMES = ("position", "velocity", "torque", "collision", "keep_out", *HIGHER)
DISTANCES = NAMES[3:5]
_SHOWN = 4  # excepted names that are told
_FAR = 0.05  # [m] between capsules, which is far enough not to look inside of them


class Constraints:
    """Limits, self-collision and keep-out regions of an arm.

    Neighbours in the chain are not checked against each other, nor are links that somebody named, nor such
    that provably cannot touch: ``pairs_of`` has the rule, and ``exempt`` lists them all. Capsules that
    violate a region in every one of 4,000 random configurations (links that cannot leave it) are excepted
    too: ``described`` says which.

    Args:
        arm: the arm.
        regions: keep-out regions in world coordinates.
        torque: whether torque limits count, where the robot states them.
        clearance: how far links stay from the regions [m]; margins of distances are what is left beyond it.
            At the edges of boxes a little more is kept. Links that never have it from a plane (those above
            the foot of the arm) merely keep out of that, as ``kept_clear`` tells.
        apart: how far links stay from each other [m]; the clearance when None.

    Attributes:
        higher: limits of acceleration and jerk, (J,), where the robot states any.
        pairs: checked capsule pairs, (P, 2).
        pieces: distances of what is inside of these capsules.
        exempt: pairs of links that are not kept apart, and why.
        guarded: region and capsule index of each keep-out check, (K, 2).
        labels: what each element of each margin is, by constraint.
        excepted: what could be checked and is not, by constraint.

    Raises:
        InfeasibleError: when links touch always that nobody named, no link ever leaves a region, or some are
            always nearer than the clearance.
    """

    def __init__(
        self,
        arm: Arm,
        regions: Sequence[Region] = (),
        torque: bool = True,
        clearance: float = 0.0,
        apart: float | None = None,
    ) -> None:
        self.arm, self.clearance = arm, clearance
        self.apart = clearance if apart is None else apart
        self._thick = thicker(arm, self.apart)
        self.body = RigidBody(arm)
        self.regions = tuple(regions)
        self.lowered: tuple[Region, ...] = ()  # of them, for links that never have the clearance
        self.kept_out = self.grown(self.regions)
        heavy = bool(arm.inertial_parameters.any())  # else torques are not known
        self.torque = torque and heavy and bool(torch.isfinite(arm.torque_limit).any())
        self.higher = arm.higher_limits
        self.excepted: dict[str, tuple[str, ...]] = {}
        found = self._pairs()
        self.pairs, self._links = found.checked, found.links
        self.exempt = (*found.neighbours, *found.named, *found.never)
        if found.named:
            self.excepted["collision"] = tuple(" – ".join(one.links) for one in found.named)
        self._named = tuple(str(one) for one in found.named)
        self._never = len(found.never)
        self.guarded = self._find_guarded()
        self.labels: dict[str, tuple[str, ...]] = dict.fromkeys(
            ("position", "velocity", *self.higher), arm.joint_names
        )
        if self.torque:
            self.labels["torque"] = arm.joint_names
        if len(self.pairs):
            self.labels["collision"] = self._pair_names(self.pairs)
        if len(self.guarded):
            self.labels["keep_out"] = self._guarded_names(self.guarded)

    def grown(self, regions: Sequence[Region]) -> tuple[Region, ...]:
        """Regions with surfaces so far out that links whose shapes are thicker keep the clearance [m]."""
        rest = self.clearance - self.apart / 2
        return tuple(region.grown(rest) if rest else region for region in regions)

    @cached_property
    def kept(self) -> dict[str, Tensor]:
        """Distances [m] that are kept beside margins of zero, by constraint: (P,) and (K,).

        Infinite for links that never have the clearance from a plane: they say nothing of a motion.
        """
        full = self.guarded[:, 0] < len(self.regions)
        return {
            "collision": torch.full((len(self.pairs),), self.apart, dtype=torch.float64),
            "keep_out": torch.where(full, self.clearance, torch.inf).double(),
        }

    @property
    def orders(self) -> int:
        """How many derivatives of the position make a state: 3, or 4 where jerk is limited."""
        return 4 if "jerk" in self.higher else 3

    @property
    def higher_rows(self) -> Tensor:
        """Limits of acceleration and jerk as kernels take them, (2, J); (2, 0) where there are none."""
        none = torch.full_like(self.arm.velocity_limit, torch.inf)
        rows = [self.higher.get(name, none) for name in HIGHER]
        return torch.stack(rows) if self.higher else none.new_zeros(len(HIGHER), 0)

    def margins(self, q: Tensor, dq: Tensor, ddq: Tensor, jerk: Tensor | None = None) -> dict[str, Tensor]:
        """Signed margins by constraint, (N, K) each [rad, rad/s, rad/s², rad/s³, N·m, m], of states (N, J).

        At least zero is feasible. In float64 on the processor, whatever the states' type and device. The
        jerk may be left out where it is not limited.

        Raises:
            ShapeError: when the states are not (N, J) each, or jerk is limited and not given.
        """
        arm, states = self.arm, [q, dq, ddq, *([] if jerk is None else [jerk])]
        if any(x.shape != (len(q), arm.joints) for x in states):
            shapes = ", ".join(str(tuple(x.shape)) for x in states)
            times = "three times" if jerk is None else "four times"
            raise ShapeError(f"states are {shapes}, expected {times} (N, {arm.joints})")
        if len(states) < self.orders:
            raise ShapeError(f"jerk of {arm.name} is limited: margins need it beside the acceleration")
        q, dq, ddq, *_ = states = [x.to("cpu", torch.float64) for x in states]
        margins = {
            "position": torch.minimum(q - arm.position_lower, arm.position_upper - q),
            "velocity": arm.velocity_limit - dq.abs(),
        }
        for name, limit in self.higher.items():
            margins[name] = limit - states[HIGHER[name]].abs()
        if self.torque:
            margins["torque"] = arm.torque_limit - self.body.torque(q, dq, ddq).abs()
        margins |= self._distances(q)
        if self.pieces.finer.any():
            margins["collision"] = self._look_inside(q, margins["collision"])
        return margins

    def at_rest(self, q: Tensor) -> dict[str, Tensor]:
        """Margins of positions (N, J) that are held."""
        still = torch.zeros_like(q)
        return self.margins(q, still, still, still)

    def relative(self, margins: dict[str, Tensor], distance: float) -> dict[str, Tensor]:
        """Margins as shares of half the range, the limit, or ``distance`` [m]; 1 where nothing limits."""
        arm = self.arm
        whole = {
            "position": (arm.position_upper - arm.position_lower) / 2,
            "velocity": arm.velocity_limit,
            **self.higher,
            "torque": arm.torque_limit,
        }
        shares = {}
        for name, margin in margins.items():
            scale = whole.get(name, torch.tensor(distance, dtype=torch.float64)).to(margin)
            shares[name] = torch.where(torch.isfinite(scale), margin / scale, torch.ones_like(margin))
        return shares

    def _distances(self, q: Tensor) -> dict[str, Tensor]:
        """Margins of distances of capsules, which those of what is inside of them are never smaller than."""
        found = clearances(self.body.chain, self.shapes, q)
        return {name: x for name, x in zip(DISTANCES, found) if name in self.labels}

    @cached_property
    def pieces(self) -> PieceDistances:
        """Distances of what is inside of the checked pairs' capsules."""
        return PieceDistances(self._thick, self.pairs)

    @cached_property
    def shapes(self) -> Shapes:
        """Capsules and regions as compiled kernels take them."""
        return self._shapes_of(self.pairs, self.guarded)

    def _shapes_of(self, pairs: Tensor, guarded: Tensor) -> Shapes:
        return shapes_of(self._thick.capsules, pairs, guarded, tables(self.kept_out))

    def described(self) -> str:
        """Description of what is checked and what is not, as one line for people."""
        torque = int(torch.isfinite(self.arm.torque_limit).sum()) if self.torque else 0
        pairs, links = self.excepted.get("collision", ()), self.excepted.get("keep_out", ())
        capsules = self.arm.capsules
        shaped = set() if capsules.points else set(capsules.link[capsules.link >= 0].tolist())
        bare, noun = self.arm.joints - len(shaped), "joint origin" if capsules.points else "link"
        limited = {name: int(limit.isfinite().sum()) for name, limit in self.higher.items()}
        higher = "".join(f"{name} of {count}, " for name, count in limited.items())
        never = f"; {self._never} never touch" if self._never else ""
        parts = [
            f"position and velocity of {counted(self.arm.joints, 'joint')}, {higher}torque of {torque}",
            f"{self._links} of {counted(self._links + len(pairs), 'pair')} of links"
            + _except(self._named, "may touch")
            + never,
            f"{len(self.guarded)} of {counted(len(self.guarded) + len(links), noun)} in "
            + counted(len(self.regions), "region")
            + _except(links, "never out"),
            *([f"{self.kept_clear} kept clear"] if self.clearance else []),
        ]
        unchecked = f"; not checked: {counted(bare, 'link')} without a shape" if bare else ""
        return "; ".join(parts) + unchecked

    @property
    def kept_clear(self) -> str:
        """The distances that are kept, for people."""
        links = f" from regions and {self.apart:g} m between links" if self.apart != self.clearance else ""
        near = self.guarded[self.guarded[:, 0] >= len(self.regions)]
        return f"{self.clearance:g} m{links}" + _except(self._guarded_names(near), "never so far")

    def nearest(self, q: Tensor) -> tuple[Tensor, Tensor]:
        """Smallest distance [m], (N,), of links from each other and from regions, and whose, at (N, J).

        Distances count from ``DISTANCES`` and their labels, one after the other, and are lower bounds from
        some centimetres on. Infinite where nothing is near. Links that never have the clearance from a plane
        are left out, and so are joint origins, which stand for links without shapes.
        """
        far = q.new_full((len(q), 1), torch.inf)
        if self.arm.capsules.points:
            return far[:, 0], torch.zeros(len(q), dtype=torch.long)
        margins = self.at_rest(q)
        near = [margins[name] + self.kept[name] for name in DISTANCES if name in margins]
        return torch.cat([*near, far], 1).min(1)

    def refuse_home(self, home: Sequence[float]) -> None:
        """Refuse a home position where the arm cannot rest.

        Raises:
            ShapeError: when it is not one finite number per joint.
            InfeasibleError: names each violated limit, pair or region, with its margin.
        """
        q = torch.tensor([list(home)], dtype=torch.float64)
        if q.shape[1] != self.arm.joints or not torch.isfinite(q).all():
            raise ShapeError(f"home position {list(home)} must be {self.arm.joints} finite joint positions")
        faults: dict[str, float] = {}  # the worst of what has one name: parts of links
        for name, margin in self.at_rest(q).items():
            for k in torch.nonzero(margin[0] < 0)[:, 0].tolist():
                which = f"{name} of {self.labels[name][k]}"
                faults[which] = min(faults.get(which, 0.0), float(margin[0, k]))
        if faults:
            said = "; ".join(f"{which}: margin {margin:.4g}" for which, margin in faults.items())
            raise InfeasibleError(f"home position {list(home)} is not feasible: {said}")

    def _look_inside(self, q: Tensor, margin: Tensor) -> Tensor:
        """Distances [m], (N, P), of what is inside of capsules where these are near each other or touch."""
        asked = torch.nonzero((margin < _FAR) & self.pieces.finer)
        n, p = asked.unbind(1)
        margin[n, p] = torch.maximum(margin[n, p], self.pieces.lower(q, asked))
        return margin

    def _find_guarded(self) -> Tensor:
        moving = torch.nonzero(self.arm.capsules.link >= 0)[:, 0]
        guarded = torch.cartesian_prod(torch.arange(len(self.regions)), moving).reshape(-1, 2)
        if len(guarded):
            shapes = self._shapes_of(guarded[:0], guarded)
            farthest = clearances(self.body.chain, shapes, sampled(self.arm))[1].amax(0)
            leaves = farthest + self.clearance > 0
            self._except_guarded(guarded, leaves)
            short = leaves & (farthest <= 0)
            short &= ~self._lower(guarded, short)
            if short.any():
                names = self._guarded_names(guarded[short])
                raise too_large(self.clearance, names, float(farthest[short].min()))
            guarded = guarded[leaves]
        return guarded[guarded[:, 0].argsort(stable=True)]

    def _lower(self, guarded: Tensor, short: Tensor) -> Tensor:
        """Have links that never have the clearance from planes merely keep out of these: which they are."""
        planes = [r for r, region in enumerate(self.regions) if isinstance(region, Plane)]
        index = torch.full((len(self.regions),), -1)
        index[planes] = torch.arange(len(planes)) + len(self.regions)
        which = short & (index[guarded[:, 0]] >= 0)
        if which.any():
            guarded[which, 0] = index[guarded[which, 0]]
            self.lowered = tuple(self.regions[r].grown(-self.clearance) for r in planes)
            self.kept_out = self.grown((*self.regions, *self.lowered))
        return which

    def _pairs(self) -> Pairs:
        """The pairs that are kept apart, by the clearance."""
        if not self.apart:
            return pairs_of(self.arm)
        try:
            return pairs_of(self._thick)
        except InfeasibleError:
            pairs_of(self.arm)  # links that touch without any clearance are refused with what helps
            near = usual_gaps(self._thick)
            names = [" – ".join(links) for links in near]
            raise too_large(self.apart, names, min(near.values(), default=-torch.inf)) from None

    def _except_guarded(self, guarded: Tensor, leaves: Tensor) -> None:
        """Keep which links never leave a region; refuse a region that none does."""
        for index in range(len(self.regions)):
            if not leaves[guarded[:, 0] == index].any():
                raise InfeasibleError(
                    f"region {index} cannot be kept: no link is outside of it in any of {SAMPLES:,} random "
                    "configurations"
                )
        if not leaves.all():
            self.excepted["keep_out"] = self._guarded_names(guarded[~leaves])

    def _pair_names(self, pairs: Tensor) -> tuple[str, ...]:
        names = self.arm.capsules.names
        return tuple(f"{names[i]} – {names[j]}" for i, j in pairs.tolist())

    def _guarded_names(self, guarded: Tensor) -> tuple[str, ...]:
        names, planes = self.arm.capsules.names, [isinstance(region, Plane) for region in self.regions]
        of = [*range(len(self.regions)), *(r for r, plane in enumerate(planes) if plane)]
        return tuple(f"{names[k]} in region {of[r]}" for r, k in guarded.tolist())


def _except(names: tuple[str, ...], why: str) -> str:
    """The first of some names, and why they are excepted."""
    return f" ({why}: {listed(names, _SHOWN)})" if names else ""
