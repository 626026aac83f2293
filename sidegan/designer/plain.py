"""The designer's arithmetic in plain torch: the reference, and what works where nothing is compiled."""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from sidegan.design.lbfgs import BatchedLbfgs
from sidegan.design.linear import with_terms
from sidegan.design.objective import HIGHEST, LOWEST, SHARPNESS
from sidegan.design.problem import HOPELESS
from sidegan.designer.aim import Aim
from sidegan.designer.descent import Grid, Penalties
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.motion import plain

Array = np.ndarray
Objective = Callable[[Tensor], tuple[Tensor, Tensor]]

_TINY = 1e-300


def smooth_ratio(values: Tensor) -> Tensor:
    """Smooth log ratio of the largest to the smallest of positive values, (K,) ascending."""
    logs = torch.maximum(values, values[-1].detach() / HOPELESS).clamp_min(_TINY).log()
    low, high = -SHARPNESS * logs[:LOWEST], SHARPNESS * logs[-HIGHEST:]
    return (torch.logsumexp(low, 0) + torch.logsumexp(high, 0)) / SHARPNESS


class PlainDescents:
    """Descents for one arm in its workspace."""

    def __init__(self, numbers: ArmNumbers, grid: Grid) -> None:
        self.numbers, self.grid = numbers, grid
        self._basis = torch.from_numpy(numbers.basis(grid.samples, 3))
        orders = 2 + len(numbers.limits)
        self._fine = torch.from_numpy(numbers.basis(grid.samples * grid.refine, orders))

    def descent(self, scene: Scene, aim: Aim, penalties: Penalties) -> "PlainDescent":
        """A descent in a scene."""
        return PlainDescent(self, scene, aim, penalties)

    def objective(self, scene: Scene, aim: Aim, penalties: Penalties) -> Objective:
        """Goal and penalty, 0-dimensional each, at points (J, K)."""
        orders = torch.tensor([[[scene.period ** (1.0 - r)]] for r in range(4)], dtype=torch.float64)
        basis, fine = self._basis * orders[:3], self._fine * orders[: len(self._fine)]
        turn, size, home = (torch.from_numpy(x) for x in (self.numbers.turn, scene.size, scene.home))
        goal, cost = self._goal(aim, scene.period), self._cost(scene, penalties)

        def function(x: Tensor) -> tuple[Tensor, Tensor]:
            c = (x * size) @ turn.T
            q, dq, ddq = (c @ b for b in basis)
            states = tuple(s.T for s in (home[:, None] + q, dq, ddq))
            position, *rest = ((c @ b).T for b in fine)
            return goal(states), cost(states, home + position, rest)

        return function

    def _goal(self, aim: Aim, period: float) -> Callable[[tuple[Tensor, ...]], Tensor]:
        body = self.numbers.constraints.body
        roots = torch.from_numpy(aim.roots_of(body.joints))
        wanted = aim.numbers(body)
        order, subspace, prior, targets = map(
            torch.from_numpy, (wanted.order, wanted.subspace, wanted.prior, wanted.targets)
        )
        amount = self.grid.rate * period

        def function(states: tuple[Tensor, ...]) -> Tensor:
            y = plain.regressor(body, states)[..., body.base.columns]
            if aim.model is not None:
                y = with_terms(aim.model, y, *states[1:])[..., order]
            y = (y * roots[:, None]).flatten(0, 1)
            gram = y.T @ y / len(states[0])
            if aim.kind == "diagonal":
                return smooth_ratio(gram.diagonal().sort().values)
            inner = subspace.T @ gram @ subspace
            if aim.kind == "condition":
                return smooth_ratio(torch.linalg.eigvalsh(inner))
            factor, failed = torch.linalg.cholesky_ex(prior + amount * inner)
            if failed:
                return torch.tensor(torch.inf, dtype=torch.float64)
            if aim.kind == "determinant" and aim.interest is None:
                return -2 * factor.diagonal().log().sum()
            half = torch.linalg.solve_triangular(factor, targets.T, upper=False)
            return torch.logdet(half.T @ half) if aim.kind == "determinant" else half.square().sum().log()

        return function

    def _cost(
        self, scene: Scene, penalties: Penalties
    ) -> Callable[[tuple[Tensor, ...], Tensor, list[Tensor]], Tensor]:
        numbers, weight = self.numbers, penalties.weight
        upper, lower = torch.from_numpy(numbers.upper), torch.from_numpy(numbers.lower)
        limits = [torch.from_numpy(limit) for limit in (scene.speed, *numbers.limits)]
        torque = torch.from_numpy(scene.torque)
        body = numbers.constraints.body
        constraints = numbers.among(scene)

        def function(states: tuple[Tensor, ...], q: Tensor, rest: list[Tensor]) -> Tensor:
            uses = [2 * (q - (upper + lower) / 2).abs() / (upper - lower) + penalties.reserve]
            uses += [x.abs() / limit + penalties.reserve for x, limit in zip(rest, limits)]
            total = torch.stack([((use - 1).clamp_min(0) ** 2).sum() / len(q) for use in uses]).sum()
            if bool(torch.isfinite(torque).any()):
                used = body.torque(*states).abs() / torque + penalties.torque
                total = total + ((used - 1).clamp_min(0) ** 2).sum() / len(used)
            total = weight * total
            if len(constraints.pairs) + len(constraints.guarded):
                lack = (penalties.reach - constraints.distances(q)).clamp_min(0)
                total = total + penalties.close * (lack**2).sum() / len(q)
            return total

        return function


class PlainDescent:
    """L-BFGS on one scene."""

    def __init__(self, owner: PlainDescents, scene: Scene, aim: Aim, penalties: Penalties) -> None:
        self._owner, self._scene, self._aim = owner, scene, aim
        self._x = np.zeros_like(scene.size)
        self._search: BatchedLbfgs | None = None
        self.penalise(penalties)

    def penalise(self, penalties: Penalties) -> None:
        """Go on with other penalties."""
        if self._search is not None:
            self._x = self.x
        self._search = None
        self._objective = self._owner.objective(self._scene, self._aim, penalties)

    def place(self, x: Array) -> None:
        """Begin at a point (J, K)."""
        self._x, self._search = np.array(x), None

    def run(self, evaluations: int) -> None:
        """So many evaluations."""
        for _ in range(evaluations):
            if self._search is None:
                self._search = BatchedLbfgs(self._function, torch.from_numpy(self._x).reshape(1, -1))
            else:
                self._search.iterate()

    def _function(self, x: Tensor) -> tuple[Tensor, Tensor]:
        gradient = np.zeros_like(self._x)
        value = sum(self.evaluate(x[0].numpy().reshape(gradient.shape), gradient))
        return torch.tensor([value], dtype=torch.float64), torch.from_numpy(gradient.reshape(1, -1))

    def evaluate(self, x: Array, gradient: Array) -> tuple[float, float]:
        """Goal and penalty of a point (J, K); writes the gradient of their sum."""
        with torch.enable_grad():
            at = torch.from_numpy(np.ascontiguousarray(x)).requires_grad_(True)
            goal, cost = self._objective(at)
            if not bool(torch.isfinite(goal)):
                gradient[:] = 0.0
                return float("inf"), 0.0
            gradient[:] = torch.autograd.grad(goal + cost, at)[0].numpy()
        return float(goal.detach()), float(cost.detach())

    @property
    def x(self) -> Array:
        """Where it is, (J, K)."""
        return (
            self._x.copy() if self._search is None else self._search.x.numpy().reshape(self._x.shape).copy()
        )

    @property
    def coefficients(self) -> Array:
        """Coefficients (J, K) [rad/s] there."""
        return (self.x * self._scene.size) @ self._owner.numbers.turn.T

    @property
    def _values(self) -> tuple[float, float]:
        return self.evaluate(self.x, np.zeros_like(self._x))

    @property
    def goal(self) -> float:
        """The goal there."""
        return self._values[0]

    @property
    def cost(self) -> float:
        """The penalty there."""
        return self._values[1]
