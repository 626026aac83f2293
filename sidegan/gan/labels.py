"""Exactly labelled samples for the surrogates: labels are cheap because the physics is ours."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.design.excitation import excitation_of
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

_DISTANCE = 0.1  # [m] clearance that counts like a whole joint range
_CLIP = 1.0  # scaled margins beyond this carry no information about validity
_BATCH = 250
_SMALLEST, _LARGEST = 0.8, 1.2  # of what surrogates learn from, in its own size


class Labelled(NamedTuple):
    """Samples with their true labels."""

    c: Tensor  # coefficients, (N, J, H, 2) float32
    valid: Tensor  # dense validity, (N,)
    margins: Tensor  # scaled margins by moment, (N, G, T) float32, clipped to ±1
    spectrum: Tensor  # spectrum of YᵀY, (N, p)
    diagonal: Tensor  # diagonal of YᵀY, (N, p)
    energies: Tensor  # by ``reward.Energies``, (N, K); (N, 0) where they are not wanted

    def take(self, rows: Tensor) -> "Labelled":
        """Some of the samples."""
        return Labelled(*(x[rows] for x in self))

    @staticmethod
    def join(parts: Iterable["Labelled"]) -> "Labelled":
        """All samples of several parts."""
        return Labelled(*map(torch.cat, zip(*parts)))


def blend(seeds: Tensor, others: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Coefficients (count, J, H, 2) for the surrogates to learn from.

    Half are seeds, half are others (a vanilla GAN's output), each at 0.8 to 1.2 of its size: optimised seeds
    sit on the boundary of what is valid, so that both sides of it are seen.
    """
    half = count // 2
    parts = [
        x[torch.randint(len(x), (n,), generator=generator)]
        for x, n in ((seeds, half), (others, count - half))
    ]
    sizes = torch.rand(count, 1, 1, 1, generator=generator, dtype=torch.float64)
    return torch.cat(parts) * (_SMALLEST + (_LARGEST - _SMALLEST) * sizes)


@torch.no_grad()
def label(
    constraints: Constraints,
    trajectory: Trajectory,
    c: Tensor,
    steps: int,
    progress: Report,
    energies: Callable[[Tensor], Tensor] | None = None,
) -> Labelled:
    """True labels of coefficients (N, J, H, 2); ``steps`` time points per trajectory for the margins."""
    parts = []
    for done, batch in enumerate(c.split(_BATCH)):
        excitation = excitation_of(constraints.body, gram(constraints.body, trajectory, batch))
        valid = check(constraints, trajectory, batch).valid
        margins = scaled_margins(constraints, trajectory, batch, steps)
        more = batch[:, 0, 0, :0] if energies is None else energies(batch)
        parts.append(Labelled(batch.float(), valid, margins, excitation.spectrum, excitation.diagonal, more))
        progress(min(len(c), (done + 1) * _BATCH), len(c))
    return Labelled.join(parts)


def scaled_margins(constraints: Constraints, trajectory: Trajectory, c: Tensor, steps: int) -> Tensor:
    """Smallest margin of each constraint by moment, (B, G, T) float32, in shares of its limit."""
    times = trajectory.grid(steps)
    motion = [trajectory.derivative(c, times, order) for order in range(constraints.orders)]
    states = [x.flatten(0, 1) for x in motion]
    margins = constraints.relative(constraints.margins(*states), _DISTANCE)
    rows = [margins[name].amin(1) for name in constraints.labels]
    return torch.stack(rows, 1).clamp(-_CLIP, _CLIP).float().reshape(len(c), steps, -1).transpose(1, 2)
