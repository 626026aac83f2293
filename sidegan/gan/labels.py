"""Samples for the surrogates with exact labels, which the compiled physics makes cheap."""

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

_DISTANCE = 0.1  # clearance equivalent to a whole joint range [m]
_CLIP = 1.0  # larger scaled margins carry no information about validity
_BATCH = 250
_SMALLEST, _LARGEST = 0.8, 1.2  # range of random scales of the samples


class Labelled(NamedTuple):
    """Samples with their exact labels."""

    c: Array  # coefficients, (N, J, H, 2) float32
    valid: Array  # validity over the whole period, (N,)
    margins: Array  # scaled margins over time, (N, G, T) float32, clipped to ±1
    spectrum: Array  # spectrum of YᵀY, (N, p)
    diagonal: Array  # diagonal of YᵀY, (N, p)
    energies: Array  # of ``reward.Energies``, (N, K); (N, 0) if not requested

    def take(self, rows: Array) -> "Labelled":
        """The samples of these rows."""
        return Labelled(*(x[rows] for x in self))

    @staticmethod
    def join(parts: Iterable["Labelled"]) -> "Labelled":
        """All samples of several parts."""
        return Labelled(*map(np.concatenate, zip(*parts)))


def blend(seeds: Array, others: Array, count: int, seed: int) -> Array:
    """Coefficients (count, J, H, 2) for the surrogates to learn from.

    Half are seeds, half are others (samples of a vanilla GAN), each scaled by 0.8 to 1.2: optimised seeds are
    on the boundary of validity, so that scaling puts samples on both sides of it.
    """
    half = count // 2
    noise = torch.Generator().manual_seed(seed)
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
    """Exact labels of coefficients (N, J, H, 2), with margins at ``steps`` time points per trajectory."""
    parts = []
    for done, batch in enumerate(split(c, _BATCH)):
        excitation = excitation_of(constraints.body, gram(constraints.body, trajectory, batch))
        valid = check(constraints, trajectory, batch).valid
        margins = scaled_margins(constraints, trajectory, batch, steps)
        reward = batch[:, 0, 0, :0] if energies is None else energies(batch)
        single = batch.astype(np.float32)
        parts.append(Labelled(single, valid, margins, excitation.spectrum, excitation.diagonal, reward))
        progress(min(len(c), (done + 1) * _BATCH), len(c))
    return Labelled.join(parts)


def scaled_margins(constraints: Constraints, trajectory: Trajectory, c: Array, steps: int) -> Array:
    """Smallest margin of each constraint over time, (B, G, T) float32, relative to its limit."""
    times = trajectory.grid(steps)
    motion = [trajectory.derivative(c, times, order) for order in range(constraints.orders)]
    states = [x.reshape(-1, x.shape[2]) for x in motion]
    margins = constraints.relative(constraints.margins(*states), _DISTANCE)
    rows = [margins[name].min(1).reshape(len(c), steps) for name in constraints.labels]
    return np.stack(rows, 1).clip(-_CLIP, _CLIP).astype(np.float32)
