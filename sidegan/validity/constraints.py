"""Every constraint of an arm in its workspace, as signed margins of single states."""

from collections.abc import Sequence
from functools import cached_property

import torch
from torch import Tensor

from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.compiled.chain import BOX, PLANE, Shapes
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.validity.capsules import capsule_axes, segment_distance
from sidegan.validity.regions import Plane, Region

_SAMPLES = 4_000  # random configurations that decide which pairs touch always


class Constraints:
    """Limits, self-collision and keep-out regions of an arm.

    Adjacent capsules are not checked against each other; pairs that touch in every one of 4,000
    random configurations, and capsules that violate a region in every one (links that cannot leave
    it), are excepted too.

    Args:
        arm: the arm.
        regions: keep-out regions in world coordinates.
        torque: whether torque limits count, where the robot states them.

    Attributes:
        pairs: checked capsule pairs, (P, 2).
        guarded: region and capsule index of each keep-out check, (K, 2).
        labels: what each element of each margin is, by constraint.
    """

    def __init__(self, arm: Arm, regions: Sequence[Region] = (), torque: bool = True) -> None:
        self.arm = arm
        self.body = RigidBody(arm)
        self.regions = tuple(regions)
        self.torque = torque and bool(torch.isfinite(arm.torque_limit).any())
        self.pairs, self.guarded = self._find_pairs()
        names = arm.capsules.names
        self.labels: dict[str, tuple[str, ...]] = {"position": arm.joint_names, "velocity": arm.joint_names}
        if self.torque:
            self.labels["torque"] = arm.joint_names
        if len(self.pairs):
            self.labels["collision"] = tuple(f"{names[i]} – {names[j]}" for i, j in self.pairs.tolist())
        if len(self.guarded):
            self.labels["keep_out"] = tuple(f"{names[k]} in region {r}" for r, k in self.guarded.tolist())

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
        random = torch.Generator().manual_seed(0)
        draw = torch.rand(arm.joints, _SAMPLES, generator=random, dtype=torch.float64)
        q = torch.lerp(arm.position_lower[:, None], arm.position_upper[:, None], draw)
        a, b = capsule_axes(arm, q)
        pairs = torch.combinations(torch.arange(count))
        pairs = pairs[(link[pairs[:, 0]] - link[pairs[:, 1]]).abs() > 1]
        if len(pairs):
            pairs = pairs[(self._pair_distances(a, b, pairs) > 0).any(1)]
        moving = torch.nonzero(link >= 0)[:, 0]
        guarded = torch.cartesian_prod(torch.arange(len(self.regions)), moving).reshape(-1, 2)
        if len(guarded):
            guarded = guarded[(self._region_distances(a, b, guarded) > 0).any(1)]
        return pairs, guarded
