"""Conditions of one arm in its workspace: drawn at random, made from a request, encoded, refused."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from sidegan.conditional.columns import Column, columns_of
from sidegan.conditional.condition import Condition
from sidegan.conditional.settings import KINDS, Ranges, Request
from sidegan.conditional.surroundings import Surroundings
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_ROUNDS, _SPARE = 50, 3  # of drawing; three times as many as are needed in each
_APART = 0.02  # [m] that a drawn home keeps from collisions and from the workspace's regions
_TWO_LINKS = 0.4  # share of conditions about links that name two
_OPTIONAL = ("plane", "walls", "obstacle")  # kinds that are not drawn at all without a range


@dataclass(frozen=True)
class ConditionSpace:
    """Conditions that a generator of one arm can be trained for.

    Raises:
        ConfigError: when the ranges leave out what holds where nothing is requested.
    """

    constraints: Constraints  # the arm in its workspace
    # the family of trajectories whose home and period hold where no other is requested
    trajectory: Trajectory
    ranges: Ranges  # what may be requested

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
    def identifiable(self) -> Tensor:
        """Which links have parameters of their own, (J,)."""
        arm, columns = self.constraints.arm, self.constraints.body.base.columns
        return torch.isin(torch.arange(arm.joints), columns // 10)

    @cached_property
    def columns(self) -> dict[str, Column]:
        """Range of every column of a condition."""
        return columns_of(self.ranges, self.trajectory, self.identifiable)

    @property
    def size(self) -> int:
        """Numbers in a code."""
        return self.encode(self.neutral(1)).shape[1]

    def encode(self, condition: Condition) -> Tensor:
        """Code that the network sees, (B, E) float32 in [−1, 1]; what cannot be requested is left out.

        An obstacle is whether there is one, where and how large, with zeros where there is none.
        """
        code = [condition.home[:, :0]]
        for name, column in self.columns.items():
            x = getattr(condition, name)
            if column.kind not in self.ranges.kinds:
                continue
            if name == "obstacle":
                there = x[:, 3:] > 0
                code += [2.0 * there - 1, torch.where(there, column.centred(x), 0.0)]
            else:
                code.append(x if name == "links" else column.centred(x))
        return torch.cat(code, 1).clamp(-1, 1).float()

    def neutral(self, count: int) -> Condition:
        """Conditions that request nothing."""
        values = {name: column.neutral for name, column in self.columns.items()}
        return Condition(**{name: x.expand(count, *x.shape) for name, x in values.items()})

    def condition(self, request: Request) -> Condition:
        """One condition, of what is requested; the rest is neutral.

        Raises:
            ConfigError: for a link or a joint too many or too few.
        """
        joints, home = self.trajectory.joints, request.home
        if home is not None and len(home) != joints:
            raise ConfigError(f"home is {list(home)}, expected {joints} joint positions")
        given = request.columns()
        if request.links is not None:
            given["links"] = self._weights(request.links)
        values = {name: torch.tensor([x], dtype=torch.float64) for name, x in given.items()}
        return replace(self.neutral(1), **values)

    def _weights(self, links: Mapping[str, float]) -> list[float]:
        """Weight of every link, the largest 1."""
        names = self.constraints.arm.link_names
        for name in links:
            if name not in names:
                raise ConfigError(f"links has {name!r}, expected some of {', '.join(names)}")
            if not self.identifiable[names.index(name)]:
                raise ConfigError(f"links has {name!r}, which has no parameters of its own to learn")
        most = max(links.values(), default=0.0) or 1.0
        return [links.get(name, 0.0) / most for name in names]

    def draw(self, count: int, random: torch.Generator, kinds: Sequence[str] | None = None) -> Condition:
        """Random conditions whose home keeps its distance from everything.

        Each requests these kinds; when None, each kind is requested by a share of them.

        Raises:
            InfeasibleError: when hardly any home keeps its distance, with what it is close to most often.
        """
        feasible: list[Condition] = []
        faults: Counter[str] = Counter()
        for _ in range(_ROUNDS):
            drawn = self._any(_SPARE * count, random, kinds)
            margins = self.home_margins(drawn)
            good = torch.stack([x >= least for x, least in margins.values()]).all(0)
            for name, (margin, least) in margins.items():
                faults[name] += int((margin < least).sum())
            feasible.append(drawn.take(good))
            if sum(map(len, feasible)) >= count:
                return Condition.cat(feasible).take(torch.arange(count))
        often = ", ".join(f"{name} of {number}" for name, number in faults.most_common(3) if number)
        raise InfeasibleError(
            f"of {_ROUNDS * _SPARE * count} conditions drawn, {sum(map(len, feasible))} leave the arm room "
            f"at home; too close: {often}"
        )

    def _any(self, count: int, random: torch.Generator, kinds: Sequence[str] | None) -> Condition:
        """Random conditions, feasible or not."""
        base, arm = self.neutral(count), self.constraints.arm

        def shares(*shape: int) -> Tensor:
            return torch.rand(count, *shape, generator=random, dtype=torch.float64)

        values: dict[str, Tensor] = {}
        for name, column in self.columns.items():
            if name == "links":
                values[name] = self._links(shares(arm.joints), shares())
            elif name == "obstacle" and name in self.ranges.kinds:
                values[name] = column.at(torch.cat([shares(3), shares(1)], 1))
            elif column.kind not in _OPTIONAL or column.kind in self.ranges.kinds:
                values[name] = column.at(shares(*column.low.shape))
        values["home"] = torch.maximum(torch.minimum(values["home"], arm.position_upper), arm.position_lower)
        chosen = {kind: shares() < self.ranges.active for kind in KINDS}
        if kinds is not None:
            chosen = {kind: torch.full((count,), kind in kinds) for kind in KINDS}
        if not self.ranges.links:
            del values["links"]
        for name, x in values.items():
            on = chosen[self.columns[name].kind]
            values[name] = torch.where(on[:, None] if x.ndim > 1 else on, x, getattr(base, name))
        return replace(base, **values)

    def _links(self, order: Tensor, second: Tensor) -> Tensor:
        """One or two links that matter, (B, J)."""
        order = torch.where(self.identifiable, order, -1.0)
        places = order.argsort(1, descending=True).argsort(1)
        number = 1 + (second < _TWO_LINKS).long()
        return ((places < number[:, None]) & self.identifiable).double()

    def home_margins(self, condition: Condition) -> dict[str, tuple[Tensor, float]]:
        """Smallest margin of each home, (B,), and the least that a drawn one needs, by name."""
        q, constraints = condition.home, self.constraints
        room = torch.minimum(constraints.arm.position_upper - q, q - constraints.arm.position_lower)
        margins = {"position": (room.amin(1), 0.0)}
        if constraints.torque:
            used = self._gravity(condition) / constraints.arm.torque_limit
            margins["gravity"] = (condition.torque - used.amax(1), 0.0)
        margins |= {name: (x.amin(1), _APART) for name, x in constraints.clearances(q).items()}
        far = self.ranges.clearance
        near = self.surroundings.clearances(q[:, None], condition, max(far, _APART))
        least = {"plane": _APART}  # an arm cannot keep its shoulder away from the desk
        return margins | {name: (x[:, 0].amin(1), least.get(name, far)) for name, x in near.items()}

    def _gravity(self, condition: Condition) -> Tensor:
        """Torque that gravity takes at home [N·m], (B, J)."""
        still = torch.zeros_like(condition.home)
        return self.constraints.body.torque(condition.home, still, still).abs()

    def refuse(self, condition: Condition) -> None:
        """Refuse a batch of one that no generator was trained for, or no arm can meet.

        Raises:
            ConfigError: a value outside of its range, with both.
            ShapeError: a home that is not finite.
            InfeasibleError: a home that is in collision, or regions that leave no room.
        """
        constraints, home = self.constraints, condition.home
        if len(condition) != 1 or home.shape[1] != self.trajectory.joints:
            raise ShapeError(f"home is {tuple(home.shape)}, expected one of {self.trajectory.joints} joints")
        if not torch.isfinite(home).all():
            raise ShapeError(f"home {home[0].tolist()} is not finite")
        for name, column in self.columns.items():
            if name != "obstacle" or float(condition.obstacle[0, 3]) > 0:
                column.refuse_outside(name, getattr(condition, name))
        self.surroundings.refuse(condition)
        if constraints.torque:
            held, allowed = self._gravity(condition)[0], condition.torque[0] * constraints.arm.torque_limit
            for k in torch.nonzero(held > allowed)[:, 0].tolist():
                raise InfeasibleError(
                    f"gravity alone takes {float(held[k]):.4g} of the {float(allowed[k]):.4g} N·m "
                    f"that {constraints.arm.joint_names[k]} may use at home"
                )
        constraints.refuse_home(home[0].tolist())
        for name, (margin, _) in self.home_margins(condition).items():
            if float(margin[0]) < 0:
                raise InfeasibleError(f"home violates {name}: margin {float(margin[0]):.4g}")
