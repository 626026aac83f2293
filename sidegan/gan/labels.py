"""Exactly labelled samples for the surrogates: labels are cheap because the physics is ours."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import torch

from sidegan.base.arrays import Array, split
from sidegan.base.parallel import Report
from sidegan.design.excitation import excitation_of
from sidegan.gan.tensors import array
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

_DISTANCE = 0.1  # [m] clearance that counts like a whole joint range
_CLIP = 1.0  # scaled margins beyond this carry no information about validity
_BATCH = 250
_SMALLEST, _LARGEST = 0.8, 1.2  # of what surrogates learn from, in its own size


class Labelled(NamedTuple):
    """Samples with their true labels."""

    c: Array  # coefficients, (N, J, H, 2) float32
    valid: Array  # dense validity, (N,)
    margins: Array  # scaled margins by moment, (N, G, T) float32, clipped to ±1
    spectrum: Array  # spectrum of YᵀY, (N, p)
    diagonal: Array  # diagonal of YᵀY, (N, p)
    energies: Array  # by ``reward.Energies``, (N, K); (N, 0) where they are not wanted

    def take(self, rows: Array) -> "Labelled":
        """Some of the samples."""
        return Labelled(*(x[rows] for x in self))

    @staticmethod
    def join(parts: Iterable["Labelled"]) -> "Labelled":
        """All samples of several parts."""
        return Labelled(*map(np.concatenate, zip(*parts)))


def blend(seeds: Array, others: Array, count: int, seed: int) -> Array:
    """Coefficients (count, J, H, 2) for the surrogates to learn from.

    Half are seeds, half are others (a vanilla GAN's output), each at 0.8 to 1.2 of its size: optimised seeds
    sit on the boundary of what is valid, so that both sides of it are seen.
    """
    half, noise = count // 2, torch.Generator().manual_seed(seed)
    parts = [
        x[array(torch.randint(len(x), (n,), generator=noise))]
        for x, n in ((seeds, half), (others, count - half))
    ]
    sizes = array(torch.rand(count, 1, 1, 1, generator=noise, dtype=torch.float64))
    return np.concatenate(parts) * (_SMALLEST + (_LARGEST - _SMALLEST) * sizes)


def label(
    constraints: Constraints,
    trajectory: Trajectory,
    c: Array,
    steps: int,
    progress: Report,
    energies: Callable[[Array], Array] | None = None,
) -> Labelled:
    """True labels of coefficients (N, J, H, 2); ``steps`` time points per trajectory for the margins."""
    parts = []
    for done, batch in enumerate(split(c, _BATCH)):
        excitation = excitation_of(constraints.body, gram(constraints.body, trajectory, batch))
        valid = check(constraints, trajectory, batch).valid
        margins = scaled_margins(constraints, trajectory, batch, steps)
        more = batch[:, 0, 0, :0] if energies is None else energies(batch)
        single = batch.astype(np.float32)
        parts.append(Labelled(single, valid, margins, excitation.spectrum, excitation.diagonal, more))
        progress(min(len(c), (done + 1) * _BATCH), len(c))
    return Labelled.join(parts)


def scaled_margins(constraints: Constraints, trajectory: Trajectory, c: Array, steps: int) -> Array:
    """Smallest margin of each constraint by moment, (B, G, T) float32, in shares of its limit."""
    times = trajectory.grid(steps)
    motion = [trajectory.derivative(c, times, order) for order in range(constraints.orders)]
    states = [x.reshape(-1, x.shape[2]) for x in motion]
    margins = constraints.relative(constraints.margins(*states), _DISTANCE)
    rows = [margins[name].min(1).reshape(len(c), steps) for name in constraints.labels]
    return np.stack(rows, 1).clip(-_CLIP, _CLIP).astype(np.float32)
