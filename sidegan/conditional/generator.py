"""The trained conditional generator: a condition in, trajectories out; one file."""

import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.func import functional_call

from sidegan.base.storage import write_torch
from sidegan.base.typed import build
from sidegan.conditional.condition import Condition
from sidegan.conditional.problem import ConditionedProblem
from sidegan.conditional.settings import Ranges
from sidegan.conditional.space import ConditionSpace
from sidegan.errors import ArtifactError, ShapeError
from sidegan.gan.generator import opened, random_of, refuse_other, stored_network
from sidegan.gan.limits import LimitLayer, rooms
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER, Arm
from sidegan.validity import Constraints, Plane

_FORMAT = "conditional 1"
_POINTS = 120  # per period, at which everything is looked at
_KEPT = 0.01  # [m] and share of the torque limits that is kept free for what happens between the points
_HALVINGS = 6  # of the factor towards home
_AT_ONCE = 128  # trajectories: 15,000 states
_LEAST_SHARE = 0.05  # of a joint's range, that counts as its room when sizes are compared
_PEAKS = 20  # points per harmonic, at which peaks are looked for


class Shaping:
    """The last layer of a conditional generator.

    A joint whose condition allows half the speed moves half as fast: coefficients are first brought to the
    size that suits the condition, so that the network sees the same problem under all of them, then limited.
    The reach is the mean peak of random trajectories: position from home [rad or m], velocity and, where they
    are limited, acceleration and jerk, (L, J).
    """

    def __init__(self, arm: Arm, trajectory: Trajectory, reach: Tensor) -> None:
        self.arm, self.trajectory, self.reach = arm, trajectory, reach.double()
        self.layer = LimitLayer.of(arm, trajectory)
        home = torch.tensor([trajectory.home], dtype=torch.float64)
        self._usual = self._room_use(rooms(arm, home), torch.ones(1, 1), arm.velocity_limit)

    @staticmethod
    def reach_of(arm: Arm, trajectory: Trajectory, c: Tensor) -> Tensor:
        """Mean peaks, (L, J), of trajectories with coefficients (N, J, H, 2)."""
        times = trajectory.grid(_PEAKS * trajectory.harmonics)
        motion = trajectory.roll_out(c, times)
        moved = motion.position - c.new_tensor(trajectory.home)
        higher = (trajectory.derivative(c, times, HIGHER[name]) for name in arm.higher_limits)
        return torch.stack([x.abs().amax(1).mean(0) for x in (moved, motion.velocity, *higher)])

    def _room_use(self, room: Tensor, stretch: Tensor, speed: Tensor) -> Tensor:
        """What random trajectories would use of their tightest limit, (B, J)."""
        least = _LEAST_SHARE * (self.arm.position_upper - self.arm.position_lower)
        position = self.reach[0] * stretch / torch.maximum(room.amin(0), least)
        use = torch.maximum(position, self.reach[1] / speed)
        for peak, inverse in zip(self.reach[2:], self._inverse(stretch).values()):
            use = torch.maximum(use, peak * inverse)
        return use

    def _inverse(self, stretch: Tensor) -> dict[str, Tensor]:
        """One over the limits of acceleration and jerk, (B, J), of a motion that will be stretched."""
        limits = self.arm.higher_limits.items()
        return {name: 1 / (limit * stretch ** (HIGHER[name] - 1)) for name, limit in limits}

    def size(self, condition: Condition) -> Tensor:
        """Size of trajectories that suit a condition, in that of those of the family's own, (B, J)."""
        stretch = (condition.period / self.trajectory.period)[:, None]
        speed = condition.velocity[:, None] * self.arm.velocity_limit
        return self._usual / self._room_use(rooms(self.arm, condition.home), stretch, speed)

    def __call__(self, c: Tensor, condition: Condition) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), within the limits of conditions, of the network's own."""
        stretch = (condition.period / self.trajectory.period)[:, None]
        limits = {
            "room": (rooms(self.arm, condition.home) / stretch).to(c),
            "speed": (condition.velocity[:, None] * self.arm.velocity_limit).to(c),
        }
        limits |= {f"inverse_{name}": x.to(c) for name, x in self._inverse(stretch).items()}
        return functional_call(self.layer, limits, (c * self.size(condition)[:, :, None, None].to(c),))


@dataclass(frozen=True)
class ConditionalGenerator:
    """A generator with the conditions that it is trained for."""

    network: Generator  # noise and code of the condition → images
    scaling: Scaling  # images → coefficients
    reach: Tensor  # mean peaks of random trajectories, (L, J) (``Shaping``)
    space: ConditionSpace  # the arm in its workspace, the family of trajectories, the ranges of conditions

    @cached_property
    def shaping(self) -> Shaping:
        """The last layer."""
        return Shaping(self.space.constraints.arm, self.space.trajectory, self.reach)

    def coefficients(self, condition: Condition, random: torch.Generator | None = None) -> Tensor:
        """One trajectory's coefficients [rad/s] for each of B conditions, (B, J, H, 2) float64.

        As the network makes them, with a gradient, and without a look at the conditions.
        """
        noise = self.network.draw(len(condition), random)
        code = self.space.encode(condition).to(noise)
        images = self.network(torch.cat([noise[:, : noise.shape[1] - code.shape[1]], code], 1))
        return self.shaping(self.scaling.to(images).coefficients(images), condition).double()

    @torch.no_grad()
    def sample_each(self, condition: Condition, random: torch.Generator, settled: bool = True) -> Tensor:
        """The same, (B, J, H, 2) float64, without gradient, and settled where that is chosen."""
        c = self.coefficients(condition, random)
        return settle(self.space, condition, c) if settled else c

    def sample(
        self,
        count: int,
        condition: Condition | None = None,
        seed: int | torch.Generator = 0,
        settled: bool = True,
    ) -> tuple[Trajectory, Tensor]:
        """Family, with its home and period, and new coefficients [rad/s], (count, J, H, 2) float64.

        All have the same condition, a batch of one; the neutral one when None. Settled trajectories are made
        smaller until they leave no region and no torque limit (``settle``).

        Raises:
            ShapeError: when count is not positive; for the condition as of ``ConditionSpace.refuse``.
        """
        if count < 1:
            raise ShapeError(f"cannot sample {count} trajectories, expected a positive number")
        condition = self.space.neutral(1) if condition is None else condition
        self.space.refuse(condition)
        c = self.sample_each(condition.repeat(count), random_of(seed), settled)
        return condition.family(self.space.trajectory), c

    def save(self, path: Path) -> None:
        """Write one file of tensors and plain values."""
        arm = self.space.constraints.arm
        meta = {
            "format": _FORMAT,
            "robot": arm.name,
            "digest": arm.digest,
            "workspace": _workspace(self.space.constraints),
            "trajectory": self.space.trajectory.describe(),
            "network": self.network.settings,
            "ranges": asdict(self.space.ranges),
        }
        tensors = {"mean": self.scaling.mean, "spread": self.scaling.spread, "reach": self.reach}
        write_torch(path, {"meta": json.dumps(meta), "weights": self.network.state_dict(), **tensors})

    @classmethod
    def load(cls, path: Path, constraints: Constraints) -> "ConditionalGenerator":
        """Generator of a file that ``save`` wrote, for the arm in its workspace; no code in the file is run.

        Raises:
            ArtifactError: for a truncated or foreign file, another arm, or another workspace.
        """
        with opened(path, "conditioned generator", _FORMAT) as (meta, content):
            refuse_other(path, meta, constraints.arm)
            here = json.loads(json.dumps(_workspace(constraints)))
            if meta["workspace"] != here:
                raise ArtifactError(
                    f"{path} was trained for the workspace {meta['workspace']}, not for {here}"
                )
            family, reach = Trajectory(**meta["trajectory"]), content["reach"]
            expected = (2 + len(constraints.higher), constraints.arm.joints)
            network, scaling = stored_network(meta, content, family)
            space = ConditionSpace(constraints, family, build(Ranges, meta["ranges"]))
            if network.noise <= space.size or reach.shape != expected:
                raise ArtifactError(f"{path} contradicts itself: its network does not fit its ranges")
            return cls(network.eval(), scaling, reach, space)


def _workspace(constraints: Constraints) -> dict[str, Any]:
    regions = [
        {"plane": {"normal": x.unit, "offset": x.offset}} if isinstance(x, Plane) else {"box": asdict(x)}
        for x in constraints.regions
    ]
    clearance = {"clearance": constraints.clearance} if constraints.clearance else {}
    return {"torque": constraints.torque, "regions": regions, **clearance}


@torch.no_grad()
def settle(space: ConditionSpace, condition: Condition, c: Tensor) -> Tensor:
    """Coefficients [rad/s], (B, J, H, 2), of which each keeps its condition at 120 points of its period.

    What keeps it is left as it is. The rest is made smaller, as a whole: home is clear of everything, so
    some factor above zero will do. Limits on motion that hold go on to do so.
    """
    parts = torch.arange(len(c)).split(_AT_ONCE)
    return torch.cat([_settle(space, condition.take(rows), c[rows].double()) for rows in parts])


def _settle(space: ConditionSpace, condition: Condition, c: Tensor) -> Tensor:
    kept = torch.minimum(torch.full_like(condition.period, _KEPT), _least(space, condition, 0 * c) / 2)
    factor = torch.ones_like(kept)
    rows = torch.nonzero(_least(space, condition, c) < kept)[:, 0]
    some, few, needed = condition.take(rows), c[rows], kept[rows]
    low, high = torch.zeros_like(needed), torch.ones_like(needed)
    for _ in range(_HALVINGS if len(rows) else 0):
        middle = (low + high) / 2
        good = _least(space, some, few * middle[:, None, None, None]) >= needed
        low, high = torch.where(good, middle, low), torch.where(good, high, middle)
    factor[rows] = low
    return c * factor[:, None, None, None]


def _least(space: ConditionSpace, condition: Condition, c: Tensor) -> Tensor:
    """Smallest distance [m] or free share of a torque limit over the period, (B,)."""
    constraints, around = space.constraints, space.surroundings
    problem = ConditionedProblem(
        constraints,
        space.trajectory,
        _POINTS,
        condition=condition,
        surroundings=around,
        torque=constraints.torque,
    )
    motion = problem.motion(c)
    q = motion.position
    near = list(around.clearances(q, condition, 2 * _KEPT).values())
    near += [x.unflatten(0, q.shape[:2]) for x in constraints.clearances(q.flatten(0, 1)).values()]
    if constraints.torque:
        used = constraints.body.torque(*motion[1:]).abs() / constraints.arm.torque_limit
        near.append(condition.torque[:, None, None] - used)
    least = [x.flatten(1).amin(1) for x in near]
    return torch.stack(least).amin(0) if least else torch.full_like(condition.period, torch.inf)
