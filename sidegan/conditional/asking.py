"""Conditions of one arm in its workspace: drawn at random, made from what is asked, refused."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from sidegan.conditional.condition import Condition
from sidegan.conditional.encoding import encode, refuse_outside
from sidegan.conditional.ranges import KINDS, Range, Ranges
from sidegan.conditional.surroundings import Surroundings
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_ROUNDS, _SPARE = 50, 3  # of drawing; three times as many as are wanted in each
_APART = 0.02  # [m] that a drawn home keeps from collisions and from the workspace's regions
_TWO_LINKS = 0.4  # share of conditions about links that name two


@dataclass(frozen=True)
class Asking:
    """What may be asked of one arm.

    Args:
        constraints: the arm in its workspace.
        trajectory: the family of trajectories whose home and period hold where no other is asked for.
        ranges: what may be asked for.

    Raises:
        ConfigError: when the ranges leave out what holds where nothing is asked for.
    """

    constraints: Constraints
    trajectory: Trajectory
    ranges: Ranges

    def __post_init__(self) -> None:
        period = self.ranges.period
        if period is not None and not period[0] <= self.trajectory.period <= period[1]:
            raise ConfigError(
                f"period is {list(period)}, expected a range around {self.trajectory.period:g} s, "
                "which holds where no period is asked for"
            )

    @cached_property
    def surroundings(self) -> Surroundings:
        """Distances from what conditions name."""
        return Surroundings(self.constraints)

    @cached_property
    def taught(self) -> Tensor:
        """Which links have parameters of their own, (J,)."""
        arm, columns = self.constraints.arm, self.constraints.body.base.columns
        return torch.isin(torch.arange(arm.joints), columns // 10)

    def neutral(self, count: int) -> Condition:
        """What holds where nothing is asked for."""
        ranges, joints = self.ranges, self.trajectory.joints

        def full(value: float, *shape: int) -> Tensor:
            return torch.full((count, *shape), value, dtype=torch.float64)

        return Condition(
            home=torch.tensor(self.trajectory.home, dtype=torch.float64).expand(count, -1),
            period=full(self.trajectory.period),
            velocity=full(ranges.velocity[1]),
            torque=full(ranges.torque[1]),
            plane=full(-math.inf if ranges.plane is None else ranges.plane[0]),
            walls=full(math.inf if ranges.walls is None else ranges.walls[1], 2),
            obstacle=full(0.0, 4),
            links=full(0.0, joints),
        )

    def condition(
        self,
        home: Sequence[float] | None = None,
        period: float | None = None,
        velocity: float | None = None,
        torque: float | None = None,
        plane: float | None = None,
        walls: Sequence[float] | None = None,
        obstacle: Sequence[float] | None = None,
        links: Mapping[str, float] | None = None,
    ) -> Condition:
        """One condition, of what is asked for; the rest is neutral.

        Args:
            home: joint positions at both ends [rad or m].
            period: [s].
            velocity: share of the velocity limits.
            torque: share of the torque limits.
            plane: height to stay above [m].
            walls: half-widths of the room in x and y [m].
            obstacle: centre and half edge of a cube to keep out of [m].
            links: how much each link's parameters matter, by its name.

        Raises:
            ConfigError: for a link or a joint too many or too few.
        """
        given = {"home": home, "period": period, "velocity": velocity, "torque": torque}
        given |= {"plane": plane, "walls": walls, "obstacle": obstacle}
        if home is not None and len(home) != self.trajectory.joints:
            raise ConfigError(f"home is {list(home)}, expected {self.trajectory.joints} joint positions")
        if links is not None:
            given["links"] = self._weights(links)
        values = {k: torch.tensor([v], dtype=torch.float64) for k, v in given.items() if v is not None}
        return self.neutral(1).changed(**values)

    def _weights(self, links: Mapping[str, float]) -> list[float]:
        """Weight of every link, the largest 1."""
        names = self.constraints.arm.link_names
        for name in links:
            if name not in names:
                raise ConfigError(f"links has {name!r}, expected some of {', '.join(names)}")
            if not self.taught[names.index(name)]:
                raise ConfigError(f"links has {name!r}, which has no parameters of its own to learn")
        most = max(links.values(), default=0.0) or 1.0
        return [links.get(name, 0.0) / most for name in names]

    def draw(self, count: int, random: torch.Generator, kinds: Sequence[str] | None = None) -> Condition:
        """Random conditions whose home keeps its distance from everything.

        Args:
            count: how many.
            random: random numbers.
            kinds: what each of them asks for; None: anything, each kind in a share of them.

        Raises:
            InfeasibleError: when hardly any home keeps its distance, with what it is close to most often.
        """
        found: list[Condition] = []
        faults: Counter[str] = Counter()
        for _ in range(_ROUNDS):
            drawn = self._any(_SPARE * count, random, kinds)
            margins = self.home_margins(drawn)
            good = torch.stack([x >= least for x, least in margins.values()]).all(0)
            for name, (margin, least) in margins.items():
                faults[name] += int((margin < least).sum())
            found.append(drawn.take(good))
            if sum(map(len, found)) >= count:
                return Condition.cat(found).take(torch.arange(count))
        often = ", ".join(f"{name} of {number}" for name, number in faults.most_common(3) if number)
        raise InfeasibleError(
            f"of {_ROUNDS * _SPARE * count} conditions drawn, {sum(map(len, found))} leave the arm room "
            f"at home; too close: {often}"
        )

    def _any(self, count: int, random: torch.Generator, kinds: Sequence[str] | None) -> Condition:
        """Random conditions, feasible or not."""
        ranges, joints, base = self.ranges, self.trajectory.joints, self.neutral(count)

        def uniform(bounds: Range, *shape: int) -> Tensor:
            x = torch.rand(count, *shape, generator=random, dtype=torch.float64)
            return bounds[0] + (bounds[1] - bounds[0]) * x

        arm = self.constraints.arm
        values: dict[str, Tensor] = {}
        home = base.home + uniform((-ranges.home, ranges.home), joints)
        values["home"] = torch.maximum(torch.minimum(home, arm.position_upper), arm.position_lower)
        period = ranges.period or (self.trajectory.period, self.trajectory.period)
        values["period"] = uniform((math.log(period[0]), math.log(period[1]))).exp()
        values["velocity"], values["torque"] = uniform(ranges.velocity), uniform(ranges.torque)
        if ranges.plane is not None:
            values["plane"] = uniform(ranges.plane)
        if ranges.walls is not None:
            values["walls"] = uniform(ranges.walls, 2)
        if ranges.obstacle is not None:
            share, cubes = uniform((0, 1), 3), ranges.obstacle
            centre = torch.lerp(share.new_tensor(cubes.lower), share.new_tensor(cubes.upper), share)
            values["obstacle"] = torch.cat([centre, uniform(cubes.half, 1)], 1)
        values["links"] = self._links(uniform((0, 1), joints), uniform((0, 1)))
        chosen = {kind: uniform((0, 1)) < ranges.active for kind in KINDS}
        if kinds is not None:
            chosen = {kind: torch.full((count,), kind in kinds) for kind in KINDS}
        for name, x in values.items():
            on = chosen["effort" if name in ("velocity", "torque") else name] & (
                name != "links" or ranges.links
            )
            values[name] = torch.where(on[:, None] if x.ndim > 1 else on, x, getattr(base, name))
        return base.changed(**values)

    def _links(self, order: Tensor, second: Tensor) -> Tensor:
        """One or two links that matter, (B, J)."""
        order = torch.where(self.taught, order, -1.0)
        places = order.argsort(1, descending=True).argsort(1)
        number = 1 + (second < _TWO_LINKS).long()
        return ((places < number[:, None]) & self.taught).double()

    def home_margins(self, condition: Condition) -> dict[str, tuple[Tensor, float]]:
        """Smallest margin of each home, (B,), and the least that a drawn one needs, by name."""
        q, known = condition.home, self.constraints
        still = torch.zeros_like(q)
        room = torch.minimum(known.arm.position_upper - q, q - known.arm.position_lower)
        margins = {"position": (room.amin(1), 0.0)}
        if known.torque:
            held = known.body.torque(q, still, still).abs() / known.arm.torque_limit
            margins["gravity"] = (condition.torque - held.amax(1), 0.0)
        margins |= {name: (x.amin(1), _APART) for name, x in known.clearances(q).items()}
        far = self.ranges.clearance
        near = self.surroundings.clearances(q[:, None], condition, max(far, _APART))
        least = {"plane": _APART}  # an arm cannot keep its shoulder away from the desk
        return margins | {name: (x[:, 0].amin(1), least.get(name, far)) for name, x in near.items()}

    @property
    def size(self) -> int:
        """Numbers in a code."""
        return self.encode(self.neutral(1)).shape[1]

    def encode(self, condition: Condition) -> Tensor:
        """What the network sees, (B, E) float32 in [−1, 1] (``encoding``)."""
        return encode(self.ranges, self.trajectory, condition)

    def refuse(self, condition: Condition) -> None:
        """Refuse what a batch of one asks for when it was never trained, or no arm can do it.

        Raises:
            ConfigError: a value outside of its range, with both.
            ShapeError: a home that is not finite.
            InfeasibleError: a home that is in collision, or regions that leave no room.
        """
        if len(condition) != 1 or condition.home.shape[1] != self.trajectory.joints:
            raise ShapeError(
                f"home is {tuple(condition.home.shape)}, expected one of {self.trajectory.joints} joints"
            )
        if not torch.isfinite(condition.home).all():
            raise ShapeError(f"home {condition.home[0].tolist()} is not finite")
        allowed = torch.where(self.taught, 1.0, 0.0).double()
        refuse_outside(self.ranges, self.neutral(1), allowed, condition)
        self.surroundings.refuse(condition)
        names = self.constraints.arm.joint_names
        if self.constraints.torque:
            still = torch.zeros_like(condition.home)
            held = self.constraints.body.torque(condition.home, still, still)[0].abs()
            allowed = condition.torque[0] * self.constraints.arm.torque_limit
            for k in torch.nonzero(held > allowed)[:, 0].tolist():
                raise InfeasibleError(
                    f"gravity alone takes {float(held[k]):.4g} of the {float(allowed[k]):.4g} N·m "
                    f"that {names[k]} may use at home"
                )
        self.constraints.refuse_home(condition.home[0].tolist())
        for name, (margin, _) in self.home_margins(condition).items():
            if float(margin[0]) < 0:
                raise InfeasibleError(f"home violates {name}: margin {float(margin[0]):.4g}")
