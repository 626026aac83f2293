"""Information of trajectories about the identifiable parameters: their matrices, packed."""

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

    Of each matrix the lower triangle is kept, row by row: 7.6 kB at 43 parameters. The tensor may be mapped
    from a file; work on it takes a few hundred matrices at a time.
    """

    packed: Tensor  # lower triangles, (N, q (q + 1) / 2); ``Information.of`` makes them from matrices

    def __post_init__(self) -> None:
        shape, kind = tuple(self.packed.shape), self.packed.dtype
        if len(shape) != 2 or not kind.is_floating_point or not self.size or shape[1] != _width(self.size):
            raise ShapeError(f"packed information is {shape} {kind}, expected numbers (N, q (q + 1) / 2)")
        object.__setattr__(self, "packed", self.packed.double())
        bad = ~torch.cat([part.isfinite().all(1) for part in self.packed.split(_AT_ONCE)])
        if bad.any():
            raise ShapeError(f"information of trajectory {int(bad.nonzero()[0])} is not finite")

    @classmethod
    def of(cls, matrices: Tensor) -> "Information":
        """Information of symmetric positive semidefinite matrices (N, q, q)."""
        if matrices.ndim != 3 or matrices.shape[1] != matrices.shape[2] or not matrices.shape[1]:
            raise ShapeError(f"information is {tuple(matrices.shape)}, expected (N, q, q)")
        return cls(pack(matrices).double())

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
        return float(self.packed[:, corners].sum(1).max())

    @cached_property
    def mean(self) -> Tensor:
        """Mean of the matrices, (q, q)."""
        return unpack(_sum(self.packed) / len(self), self.size)

    def matrices(self, indices: Tensor | slice) -> Tensor:
        """The matrices at ``indices``, (K, q, q)."""
        return unpack(self.packed[indices], self.size)

    def stacked(self, indices: Tensor) -> Tensor:
        """Information of a set, the sum of its matrices, (q, q); of one trajectory at least."""
        whole = indices.ndim == 1 and not indices.is_floating_point() and indices.dtype != torch.bool
        if not whole or not len(indices) or indices.min() < 0 or indices.max() >= len(self):
            raise ShapeError(f"indices are {indices.tolist()}, expected some of 0 … {len(self) - 1}")
        return unpack(_sum(self.packed, indices), self.size)

    def products(self, weights: Tensor) -> Tensor:
        """Traces of symmetric weights (R, q, q) times each matrix, (N, R), in one pass over the matrices."""
        twice = pack(2 * weights - torch.diag_embed(weights.diagonal(dim1=1, dim2=2))).T
        return self.packed @ twice

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
) -> Information:
    """Information per sample on the identifiable parameters, in their orthonormal basis, of N trajectories.

    The deviation of torque noise [N·m or N] is that of each joint, (J,), or (N, J) where it differs between
    trajectories; ones when None. Beside its result it works in memory that does not grow with their number.
    """
    trajectory.check(c)
    weights = None if deviation is None else 1 / _deviations(deviation, len(c), body.joints).to(c)
    subspace, times = body.base.subspace.to(c), trajectory.grid(samples)
    packed = c.new_zeros(len(c), _width(len(subspace)), dtype=torch.float64)
    few = _AT_ONCE if weights is None else min(_AT_ONCE, max(1, _STATES_AT_ONCE // samples))
    for start in range(0, len(c), few):
        part = slice(start, start + few)
        if weights is None:
            grams = gram(body, trajectory, c[part], samples)
        else:
            grams = weighted_gram(body, trajectory.roll_out(c[part], times), weights[part, None])
        packed[part] = pack(subspace.T @ grams @ subspace)
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
    """Sum of the rows at ``indices``, or of all, a few at a time."""
    parts = packed.split(_AT_ONCE) if indices is None else (packed[few] for few in indices.split(_AT_ONCE))
    return torch.stack([part.sum(0) for part in parts]).sum(0)
