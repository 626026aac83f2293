"""Every constraint of an arm in its workspace, as signed margins of single states."""

from collections.abc import Sequence
from functools import cached_property

import torch
from torch import Tensor

from sidegan.base.names import listed
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.compiled.chain import BOX, PLANE, Shapes
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.validity.capsules import capsule_axes, segment_distance
from sidegan.validity.regions import Plane, Region

_SAMPLES = 4_000  # random configurations that decide which pairs touch always
_DOUBTFUL = 0.25  # share of always touching pairs from which on shapes are suspicious
_SHOWN = 4  # excepted names that are told
_FEW = 3  # pairs that may all touch always: a short arm has no others


class Constraints:
    """Limits, self-collision and keep-out regions of an arm.

    Adjacent capsules are not checked against each other; pairs that touch in every one of 4,000
    random configurations, and capsules that violate a region in every one (links that cannot leave
    it), are excepted too: ``described`` says which. Where nothing is left of what was to be checked, the
    shapes or the region are wrong.

    Args:
        arm: the arm.
        regions: keep-out regions in world coordinates.
        torque: whether torque limits count, where the robot states them.

    Attributes:
        pairs: checked capsule pairs, (P, 2).
        guarded: region and capsule index of each keep-out check, (K, 2).
        labels: what each element of each margin is, by constraint.
        excepted: what is not checked, since it cannot be otherwise, by constraint.

    Raises:
        InfeasibleError: when all pairs of links touch always, or no link ever leaves a region.
    """

    def __init__(self, arm: Arm, regions: Sequence[Region] = (), torque: bool = True) -> None:
        self.arm = arm
        self.body = RigidBody(arm)
        self.regions = tuple(regions)
        self.torque = torque and bool(torch.isfinite(arm.torque_limit).any())
        self.excepted: dict[str, tuple[str, ...]] = {}
        self.pairs, self.guarded = self._find_pairs()
        self.labels: dict[str, tuple[str, ...]] = {"position": arm.joint_names, "velocity": arm.joint_names}
        if self.torque:
            self.labels["torque"] = arm.joint_names
        if len(self.pairs):
            self.labels["collision"] = self._pair_names(self.pairs)
        if len(self.guarded):
            self.labels["keep_out"] = self._guarded_names(self.guarded)

    def margins(self, q: Tensor, dq: Tensor, ddq: Tensor) -> dict[str, Tensor]:
        """Signed margins by constraint, (N, K) each [rad, rad/s, N·m, m], of N states (N, J).

        Differentiable; ≥ 0 is feasible.
        """
        arm = self.arm
        if any(x.shape != (len(q), arm.joints) for x in (q, dq, ddq)):
            shapes = ", ".join(str(tuple(x.shape)) for x in (q, dq, ddq))
            raise ShapeError(f"states are {shapes}, expected three times (N, {arm.joints})")
        lower, upper, speed = (x.to(q) for x in (arm.position_lower, arm.position_upper, arm.velocity_limit))
        margins = {"position": torch.minimum(q - lower, upper - q), "velocity": speed - dq.abs()}
        if self.torque:
            margins["torque"] = arm.torque_limit.to(q) - self.body.torque(q, dq, ddq).abs()
        return margins | self.clearances(q)

    def relative(self, margins: dict[str, Tensor], distance: float) -> dict[str, Tensor]:
        """Margins as shares of half the range, the limit, or ``distance`` [m]; 1 where nothing limits."""
        arm = self.arm
        whole = {
            "position": (arm.position_upper - arm.position_lower) / 2,
            "velocity": arm.velocity_limit,
            "torque": arm.torque_limit,
        }
        shares = {}
        for name, margin in margins.items():
            scale = whole.get(name, torch.tensor(distance, dtype=torch.float64)).to(margin)
            shares[name] = torch.where(torch.isfinite(scale), margin / scale, torch.ones_like(margin))
        return shares

    def clearances(self, q: Tensor) -> dict[str, Tensor]:
        """Signed distances [m] of capsule pairs (N, P) and to regions (N, K), of N positions (N, J)."""
        clearances: dict[str, Tensor] = {}
        if len(self.pairs) or len(self.guarded):
            a, b = capsule_axes(self.arm, q.T.contiguous())
            if len(self.pairs):
                clearances["collision"] = self._pair_distances(a, b, self.pairs).T
            if len(self.guarded):
                clearances["keep_out"] = self._region_distances(a, b, self.guarded).T
        return clearances

    def distances(self, q: Tensor) -> Tensor:
        """All of these side by side, (N, P + K); there must be some."""
        return torch.cat([*self.clearances(q).values()], 1)

    @cached_property
    def shapes(self) -> Shapes:
        """Capsules and regions as compiled kernels take them."""
        numbers = torch.tensor([region.numbers for region in self.regions], dtype=torch.float64).reshape(
            -1, 6
        )
        kinds = torch.tensor([PLANE if isinstance(region, Plane) else BOX for region in self.regions])
        return Shapes.of(self.arm.capsules, self.pairs, self.guarded, numbers, kinds.long())

    def described(self) -> str:
        """What is checked and what is not, as one line for people."""
        torque = int(torch.isfinite(self.arm.torque_limit).sum()) if self.torque else 0
        pairs, links = self.excepted.get("collision", ()), self.excepted.get("keep_out", ())
        bare = self.arm.joints - len(set(self.arm.capsules.link[self.arm.capsules.link >= 0].tolist()))
        parts = [
            f"position and velocity of {self.arm.joints} joints, torque of {torque}",
            f"{len(self.pairs)} of {len(self.pairs) + len(pairs)} pairs of links"
            + _except(pairs, "always touch"),
            f"{len(self.guarded)} of {len(self.guarded) + len(links)} links in {len(self.regions)} regions"
            + _except(links, "never out"),
        ]
        return "; ".join(parts) + (f"; {bare} links without a shape are not checked" if bare else "")

    @property
    def doubtful(self) -> bool:
        """Whether so many pairs always touch that the shapes are too large to mean anything."""
        touching = len(self.excepted.get("collision", ()))
        return touching > _DOUBTFUL * (touching + len(self.pairs))

    def refuse_home(self, home: Sequence[float]) -> None:
        """Refuse a home position where the arm cannot rest.

        Raises:
            ShapeError: when it is not one finite number per joint.
            InfeasibleError: names each violated limit, pair or region, with its margin.
        """
        q = torch.tensor([list(home)], dtype=torch.float64)
        if q.shape[1] != self.arm.joints or not torch.isfinite(q).all():
            raise ShapeError(f"home position {list(home)} must be {self.arm.joints} finite joint positions")
        still = torch.zeros_like(q)
        faults = [
            f"{name} of {self.labels[name][k]}: margin {float(margin[0, k]):.4g}"
            for name, margin in self.margins(q, still, still).items()
            for k in torch.nonzero(margin[0] < 0)[:, 0].tolist()
        ]
        if faults:
            raise InfeasibleError(f"home position {list(home)} is not feasible: {'; '.join(faults)}")

    def _pair_distances(self, a: Tensor, b: Tensor, pairs: Tensor) -> Tensor:
        first, second = pairs.to(a.device).unbind(1)
        radius = self.arm.capsules.radius.to(a)
        apart = segment_distance(a[:, first], b[:, first], a[:, second], b[:, second])
        return apart - (radius[first] + radius[second])[:, None]

    def _region_distances(self, a: Tensor, b: Tensor, guarded: Tensor) -> Tensor:
        radius = self.arm.capsules.radius.to(a)
        rows = []
        for index, region in enumerate(self.regions):
            capsules = guarded[guarded[:, 0] == index, 1].to(a.device)
            rows.append(region.margin(a[:, capsules], b[:, capsules]) - radius[capsules][:, None])
        return torch.cat(rows)

    def _find_pairs(self) -> tuple[Tensor, Tensor]:
        arm = self.arm
        link, count = arm.capsules.link, len(arm.capsules.link)
        a, b = random_axes(arm)
        pairs = torch.combinations(torch.arange(count))
        pairs = pairs[(link[pairs[:, 0]] - link[pairs[:, 1]]).abs() > 1]
        if len(pairs):
            apart = (self._pair_distances(a, b, pairs) > 0).any(1)
            self._except_pairs(pairs, apart)
            pairs = pairs[apart]
        moving = torch.nonzero(link >= 0)[:, 0]
        guarded = torch.cartesian_prod(torch.arange(len(self.regions)), moving).reshape(-1, 2)
        if len(guarded):
            leaves = (self._region_distances(a, b, guarded) > 0).any(1)
            self._except_guarded(guarded, leaves)
            guarded = guarded[leaves]
        return pairs, guarded

    def _except_pairs(self, pairs: Tensor, apart: Tensor) -> None:
        """Keep which pairs always touch; refuse shapes with which all of them do."""
        if not apart.any() and len(pairs) > _FEW:
            raise InfeasibleError(
                f"all {len(pairs)} pairs of links that are not adjacent touch in every one of {_SAMPLES:,} "
                "random configurations, so that none can be checked: are the shapes in metres?"
            )
        if not apart.all():
            self.excepted["collision"] = self._pair_names(pairs[~apart])

    def _except_guarded(self, guarded: Tensor, leaves: Tensor) -> None:
        """Keep which links never leave a region; refuse a region that none does."""
        for index in range(len(self.regions)):
            if not leaves[guarded[:, 0] == index].any():
                raise InfeasibleError(
                    f"region {index} cannot be kept: no link is outside of it in any of {_SAMPLES:,} random "
                    "configurations"
                )
        if not leaves.all():
            self.excepted["keep_out"] = self._guarded_names(guarded[~leaves])

    def _pair_names(self, pairs: Tensor) -> tuple[str, ...]:
        names = self.arm.capsules.names
        return tuple(f"{names[i]} – {names[j]}" for i, j in pairs.tolist())

    def _guarded_names(self, guarded: Tensor) -> tuple[str, ...]:
        return tuple(f"{self.arm.capsules.names[k]} in region {r}" for r, k in guarded.tolist())


def random_axes(arm: Arm) -> tuple[Tensor, Tensor]:
    """World end points [m] of the capsules' axes, two of (3, C, N), in the configurations that decide."""
    random = torch.Generator().manual_seed(0)
    draw = torch.rand(arm.joints, _SAMPLES, generator=random, dtype=torch.float64)
    return capsule_axes(arm, torch.lerp(arm.position_lower[:, None], arm.position_upper[:, None], draw))


def _except(names: tuple[str, ...], why: str) -> str:
    """The first of some names, and why they are excepted."""
    return f" ({why}: {listed(names, _SHOWN)})" if names else ""
