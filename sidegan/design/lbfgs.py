"""L-BFGS for many independent problems at once.

Every evaluation serves the whole batch: a problem whose step satisfies the Armijo condition moves
on, one whose step does not tries a shorter one in the next evaluation, beside the others.
"""

from collections.abc import Callable

import torch
from torch import Tensor

_ARMIJO = 1e-4
_SHRINK = 0.3
_CURVATURE = 1e-10  # pairs below this relative curvature are not stored

Function = Callable[[Tensor], tuple[Tensor, Tensor]]


class BatchedLbfgs:
    """Minimise B functions of n variables, each on its own.

    Args:
        function: x (B, n) → values (B,) and gradients (B, n).
        x: starting points, (B, n).
        memory: number of correction pairs kept per problem.
        step: longest first step, in the norm of x.

    Source: Nocedal and Wright 2006, algorithm 7.5, with backtracking.
    """

    def __init__(self, function: Function, x: Tensor, memory: int = 25, step: float = 0.3) -> None:
        self.function = function
        self.x, self.step = x, step
        self.value, self.gradient = function(x)
        shape = (memory, *x.shape)
        self.s, self.y = x.new_zeros(shape), x.new_zeros(shape)
        self.rho = x.new_zeros(memory, len(x))
        self.length = x.new_ones(len(x))
        self.direction = self._first_direction(self.gradient)

    def restart(self, function: Function) -> None:
        """Go on from the present points with another function (a changed penalty)."""
        self.function = function
        self.value, self.gradient = function(self.x)
        self._forget(torch.ones_like(self.value, dtype=torch.bool))

    def run(self, evaluations: int) -> None:
        """So many evaluations for every problem."""
        for _ in range(evaluations):
            self.iterate()

    def iterate(self) -> None:
        """One evaluation for every problem."""
        trial = self.x + self.length[:, None] * self.direction
        value, gradient = self.function(trial)
        slope = (self.direction * self.gradient).sum(1)
        accepted = value <= self.value + _ARMIJO * self.length * slope
        accepted &= torch.isfinite(gradient).all(1)
        self._remember(accepted, trial, gradient)
        self.x = torch.where(accepted[:, None], trial, self.x)
        self.value = torch.where(accepted, value, self.value)
        self.gradient = torch.where(accepted[:, None], gradient, self.gradient)
        direction = self._two_loops(self.gradient)
        uphill = (direction * self.gradient).sum(1) >= 0
        stuck = self.length < 1e-6
        self._forget(uphill | (stuck & ~accepted))
        fresh = accepted & ~uphill
        self.direction = torch.where(fresh[:, None], direction, self.direction)
        self.length = torch.where(fresh, 1.0, torch.where(uphill | stuck, 1.0, self.length * _SHRINK))

    def _first_direction(self, gradient: Tensor) -> Tensor:
        gradient = torch.where(torch.isfinite(gradient), gradient, 0.0)  # where there is none, stand still
        return -gradient * (self.step / gradient.norm(dim=1, keepdim=True).clamp_min(1e-12))

    def _forget(self, which: Tensor) -> None:
        self.rho[:, which] = 0
        self.direction = torch.where(which[:, None], self._first_direction(self.gradient), self.direction)
        self.length = torch.where(which, 1.0, self.length)

    def _remember(self, accepted: Tensor, x: Tensor, gradient: Tensor) -> None:
        s, y = x - self.x, gradient - self.gradient
        curvature = (s * y).sum(1)
        good = accepted & (curvature > _CURVATURE * s.norm(dim=1) * y.norm(dim=1))
        rho = 1 / curvature.clamp_min(torch.finfo(x.dtype).tiny)
        for store, new in ((self.s, s), (self.y, y), (self.rho, rho)):
            mask = good.view(-1, *(1,) * (new.ndim - 1))
            store.copy_(torch.where(mask, torch.cat([new[None], store[:-1]]), store))

    def _two_loops(self, gradient: Tensor) -> Tensor:
        used = self.rho > 0
        d = -gradient
        alphas = []
        for s, y, rho in zip(self.s, self.y, self.rho):
            alpha = rho * (s * d).sum(1)
            d = d - alpha[:, None] * y
            alphas.append(alpha)
        yy = (self.y[0] * self.y[0]).sum(1).clamp_min(torch.finfo(d.dtype).tiny)
        scale = torch.where(used[0], 1 / (self.rho[0].clamp_min(torch.finfo(d.dtype).tiny) * yy), 1.0)
        d = d * scale[:, None]
        for s, y, rho, alpha in reversed(list(zip(self.s, self.y, self.rho, alphas))):
            beta = rho * (y * d).sum(1)
            d = d + (alpha - beta)[:, None] * s
        fresh = ~used.any(0)
        longest = (4 * self.step / d.norm(dim=1, keepdim=True).clamp_min(1e-12)).clamp_max(1.0)
        return torch.where(fresh[:, None], self._first_direction(gradient), d * longest)
