"""What trajectories tell about the identifiable parameters: their information matrices, packed."""

import math
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from sidegan.design.criteria import criteria_of
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Motion, Trajectory

_AT_ONCE = 512  # matrices: 8 MB at 43 parameters
_STATES_AT_ONCE = 4096  # of the weighted regressor: 10 MB at seven joints
_PRIOR = 1e-3  # of an average trajectory


@dataclass(frozen=True, eq=False)
class Information:
    """Information matrices of N trajectories, symmetric and positive semidefinite, (q, q) each.

    Of each matrix the lower triangle is kept, row by row: 7.6 kB at 43 parameters in float64, half of that
    in float32. The tensor may be mapped from a file; work on it takes a few hundred matrices at a time.

    Args:
        packed: lower triangles, (N, q (q + 1) / 2); ``Information.of`` makes them from matrices.

    Raises:
        ShapeError: when the width is not a triangle's, or a number is not finite.
    """

    packed: Tensor

    def __post_init__(self) -> None:
        shape, kind = tuple(self.packed.shape), self.packed.dtype
        if len(shape) != 2 or not kind.is_floating_point or not self.size or shape[1] != _width(self.size):
            raise ShapeError(f"packed information is {shape} {kind}, expected numbers (N, q (q + 1) / 2)")
        bad = ~torch.cat([part.isfinite().all(1) for part in self.packed.split(_AT_ONCE)])
        if bad.any():
            raise ShapeError(f"information of trajectory {int(bad.nonzero()[0])} is not finite")

    @classmethod
    def of(cls, matrices: Tensor, dtype: torch.dtype = torch.float64) -> "Information":
        """Information of symmetric positive semidefinite matrices (N, q, q), kept in ``dtype``."""
        if matrices.ndim != 3 or matrices.shape[1] != matrices.shape[2] or not matrices.shape[1]:
            raise ShapeError(f"information is {tuple(matrices.shape)}, expected (N, q, q)")
        return cls(pack(matrices).to(dtype))

    def __len__(self) -> int:
        return len(self.packed)

    @cached_property
    def size(self) -> int:
        """Number q of parameters."""
        return (math.isqrt(8 * self.packed.shape[1] + 1) - 1) // 2

    @cached_property
    def largest(self) -> float:
        """The largest trace of a matrix."""
        corners = torch.arange(1, self.size + 1, device=self.packed.device).cumsum(0) - 1
        return float(self.packed[:, corners].double().sum(1).max())

    @cached_property
    def mean(self) -> Tensor:
        """Mean of the matrices, (q, q)."""
        return unpack(_sum(self.packed) / len(self), self.size)

    def matrices(self, indices: Tensor | slice) -> Tensor:
        """The matrices at ``indices``, (K, q, q), in float64."""
        return unpack(self.packed[indices].double(), self.size)

    def stacked(self, indices: Tensor) -> Tensor:
        """Information of a set, the sum of its matrices, (q, q); of one trajectory at least."""
        whole = indices.ndim == 1 and not indices.is_floating_point() and indices.dtype != torch.bool
        if not whole or not len(indices) or indices.min() < 0 or indices.max() >= len(self):
            raise ShapeError(f"indices are {indices.tolist()}, expected some of 0 … {len(self) - 1}")
        return unpack(_sum(self.packed, indices), self.size)

    def products(self, weights: Tensor) -> Tensor:
        """Traces of symmetric weights (R, q, q) times each matrix, (N, R), in one pass over the matrices."""
        twice = pack(2 * weights - torch.diag_embed(weights.diagonal(dim1=1, dim2=2))).T
        if self.packed.dtype == torch.float64:
            return self.packed @ twice
        return torch.cat([part.double() @ twice for part in self.packed.split(8 * _AT_ONCE)])

    def prior(self) -> Tensor:
        """Knowledge as from a thousandth of an average trajectory, (q, q): in the trajectories' own units."""
        if not len(self):
            raise ShapeError("no trajectories: they give no prior")
        if not math.isfinite(criteria_of(self.mean).condition):
            raise ShapeError("no trajectory excites some direction of the parameters: give a prior")
        return _PRIOR * self.mean


def information_of(
    body: RigidBody,
    trajectory: Trajectory,
    c: Tensor,
    samples: int = 80,
    deviation: Tensor | None = None,
    dtype: torch.dtype = torch.float64,
) -> Information:
    """Information per sample on the identifiable parameters, in their orthonormal basis, of N trajectories.

    Beside its result it works in memory that does not grow with their number.

    Args:
        body: the arm's dynamics.
        trajectory: the family of trajectories.
        c: coefficients [rad/s], (N, J, H, 2).
        samples: time points per trajectory.
        deviation: standard deviation of each joint's torque noise [N·m or N], (J,), or (N, J) where noise
            differs between trajectories, as noise in proportion to torque does; ones when None.
        dtype: in which the result is kept.

    Raises:
        ShapeError: when the coefficients do not fit or are not finite, or a deviation is not positive.
    """
    trajectory.check(c)
    weights = None if deviation is None else 1 / _deviations(deviation, len(c), body.joints).to(c)
    subspace, times = body.base.subspace.to(c), trajectory.grid(samples)
    packed = c.new_zeros(len(c), _width(len(subspace)), dtype=dtype)
    few = _AT_ONCE if weights is None else min(_AT_ONCE, max(1, _STATES_AT_ONCE // samples))
    for start in range(0, len(c), few):
        part = slice(start, start + few)
        if weights is None:
            grams = gram(body, trajectory, c[part], samples)
        else:
            grams = weighted_gram(body, trajectory.roll_out(c[part], times), weights[part, None])
        packed[part] = pack(subspace.T @ grams @ subspace).to(dtype)
    return Information(packed)


def weighted_gram(body: RigidBody, motion: Motion, weights: Tensor) -> Tensor:
    """Gram matrices per sample with each joint's rows times its weight, (J,) or (B, 1, J), (B, p, p)."""
    rows = (body.base_regressor(*motion[1:]) * weights[..., None]).flatten(1, 2)
    return rows.mT @ rows / len(motion.time)


def _deviations(deviation: Tensor, count: int, joints: int) -> Tensor:
    """One for each trajectory and joint, (N, J)."""
    if deviation.shape not in ((joints,), (count, joints)):
        raise ShapeError(
            f"deviations are {tuple(deviation.shape)}, expected ({joints},) or ({count}, {joints})"
        )
    if not (deviation.isfinite() & (deviation > 0)).all():
        raise ShapeError("deviations of torque noise must be finite and positive")
    return deviation.expand(count, joints)


def pack(matrices: Tensor) -> Tensor:
    """Lower triangles, (…, q (q + 1) / 2), of symmetric matrices (…, q, q), row by row."""
    rows, columns = torch.tril_indices(*matrices.shape[-2:], device=matrices.device)
    return matrices[..., rows, columns]


def unpack(packed: Tensor, size: int) -> Tensor:
    """Symmetric matrices, (…, q, q), of their lower triangles (…, q (q + 1) / 2)."""
    index = torch.arange(size, device=packed.device)
    low, high = torch.minimum(index[:, None], index), torch.maximum(index[:, None], index)
    return packed[..., high * (high + 1) // 2 + low]


def _width(size: int) -> int:
    return size * (size + 1) // 2


def _sum(packed: Tensor, indices: Tensor | None = None) -> Tensor:
    """Sum of the rows at ``indices``, or of all, in float64 and a few at a time."""
    parts = packed.split(_AT_ONCE) if indices is None else (packed[few] for few in indices.split(_AT_ONCE))
    return torch.stack([part.double().sum(0) for part in parts]).sum(0)
