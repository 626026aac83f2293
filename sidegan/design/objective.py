"""Value and exact gradient of the penalised condition number, for a whole batch at once.

For an eigenpair (λ, v) of YᵀY, dλ = 2 (Y v)ᵀ d(Y v), and Y v is the torque of the robot whose
inertial parameters are v: the gradient of any function of a few eigenvalues costs a few inverse
dynamics, never a differentiated regressor.
"""

import math
from collections.abc import Iterator

import torch
from torch import Tensor

from sidegan.design.penalty import Penalty
from sidegan.design.problem import HOPELESS, Problem
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.threads import eigh

_STATES_AT_ONCE = 8_192  # bounds the memory of a gradient to about 300 MB for seven joints
# The smallest eigenvalue changes places with its neighbours all the time; a smooth minimum over a few
# spares the optimiser the kinks: 20 % lower condition numbers after as many steps.
LOWEST, HIGHEST, SHARPNESS = 3, 2, 6.0

Directions = tuple[Tensor, Tensor]


def value_and_gradient(problem: Problem, c: Tensor, penalty: Penalty | None) -> tuple[Tensor, Tensor]:
    """Smooth log fitness plus penalty, (B,), and its gradient, (B, J, H, 2), at coefficients c."""
    grams = problem.gram(c.detach())
    if problem.diagonal:
        values, order = grams.diagonal(dim1=1, dim2=2).sort(1)
        vectors = torch.nn.functional.one_hot(order, values.shape[1]).to(values)
    else:
        values, vectors = eigenpairs(problem.body, grams, ends=True)
    value, slopes = smooth_condition(values)
    violation, gradient = pull_back(problem, c, directions_of(problem.body, vectors, slopes), penalty)
    return value + violation, gradient


def smooth_condition(values: Tensor) -> tuple[Tensor, Tensor]:
    """Smooth log ratio of largest to smallest of positive values, ascending, (B,), and its slopes, (B, p).

    At most (log 3 + log 2) / 6 above the logarithm of the ratio. What is under 10⁻¹² of the largest counts as
    that much, and has the slope of it. None but the first three and the last two values matter. Where none is
    positive nothing is told at all, which is as bad and has no slope.
    """
    told = values[:, -1] > 0
    floor = (values[:, -1:] / HOPELESS).clamp_min(torch.finfo(values.dtype).tiny)
    values = torch.maximum(values, floor)
    low, high = values[:, :LOWEST], values[:, -HIGHEST:]
    logs = -SHARPNESS * torch.log(low), SHARPNESS * torch.log(high)
    slopes = torch.zeros_like(values)
    slopes[:, :LOWEST] -= torch.softmax(logs[0], 1) / low
    slopes[:, -HIGHEST:] += torch.softmax(logs[1], 1) / high
    value = (torch.logsumexp(logs[0], 1) + torch.logsumexp(logs[1], 1)) / SHARPNESS
    return value.where(told, math.log(HOPELESS)), slopes.where(told[:, None], 0.0)


def eigenpairs(body: RigidBody, grams: Tensor, ends: bool = False) -> tuple[Tensor, Tensor]:
    """Eigenvalues of Gram matrices (B, p, p) in an orthonormal basis, ascending, and base vectors (B, K, p).

    At the ends, only those that ``smooth_condition`` looks at, in a fraction of the time.
    """
    from sidegan.motion.operations import extremes

    subspace = body.base.subspace
    inner = subspace.T @ grams @ subspace
    values, vectors = extremes(inner, LOWEST, HIGHEST) if ends else eigh(inner)
    return values, (subspace @ vectors).mT


def directions_of(body: RigidBody, vectors: Tensor, weights: Tensor) -> Directions:
    """Parameter vectors, (B, K, 10 J), of base vectors (B, L, p), and weights, (B, K), where any is not 0."""
    used = (weights != 0).any(0)  # most functions depend on a few eigenvalues
    full = weights.new_zeros(len(weights), int(used.sum()), 10 * body.joints)
    full[:, :, body.base.columns] = vectors[:, used].to(full)
    return full, weights[:, used]


def pull_back(
    problem: Problem, c: Tensor, directions: Directions | None, penalty: Penalty | None
) -> tuple[Tensor, Tensor]:
    """Penalty, (B,), and the gradient of penalty and energy, (B, J, H, 2), at coefficients c.

    The energy is Σ weight · |Y v|² / T over directions v: for eigenvectors of YᵀY / T and the slopes of a
    function of its eigenvalues, its gradient is that function's. Works through the states in pieces, then
    carries the gradient from the motion back to the coefficients, in which it is linear: memory does not
    grow with the number of samples.
    """
    with torch.enable_grad():
        c = c.detach().requires_grad_(True)
        motion = problem.states(c)
    body = problem.body
    vectors, weights = directions or (c.new_zeros(len(c), 0, 10 * body.joints), c.new_zeros(len(c), 0))
    costs = penalty.costs(problem.constraints) if penalty else (None, None)
    slopes, violation = [torch.zeros_like(x) for x in motion], c.new_zeros(len(c))
    for rows in _pieces(len(c), _STATES_AT_ONCE // problem.samples):
        for times in _pieces(problem.samples, _STATES_AT_ONCE):
            states = [x[rows, times].detach() for x in motion[:3]]
            cost, pieces = body.penalised_slopes(states, vectors[rows], weights[rows], *costs)
            violation[rows] += cost / problem.samples
            for slope, piece in zip(slopes, pieces):
                slope[rows, times] = piece / problem.samples
    if penalty is not None and problem.constraints.higher:
        cost, pushes = penalty.higher(problem.constraints, [x.detach() for x in motion])
        violation += cost / problem.samples
        for order, push in pushes.items():
            slopes[order] += push / problem.samples
    (gradient,) = torch.autograd.grad(motion, c, slopes)
    return violation, gradient


def _pieces(count: int, size: int) -> Iterator[slice]:
    size = max(1, size)
    return (slice(start, start + size) for start in range(0, count, size))
