"""Optimal experimental design: the trajectories whose information together is largest.

All of it is deterministic: criteria that differ by no more than rounding count as equal, and among equals
the first index wins. A prior is information of earlier runs, positive definite, (q, q);
``information.prior()`` when None. Priors, sets and counts that cannot be are refused with a ShapeError.
"""

import math
from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from sidegan.design.criteria import DETERMINANT, Criterion, inverse, variance
from sidegan.design.information import Information
from sidegan.errors import ShapeError

_TIE = 1e-9  # criteria (logarithms) that differ by less are equal
_FIRST, _MOST = 64, 1024  # candidates evaluated at once: few where bounds decide, at most 15 MB of 43 × 43
_ROUNDING = 4  # inverse, bound and value each lose about p ε of the condition


def d_optimal(information: Information, count: int, prior: Tensor | None = None) -> Tensor:
    """Indices of the greedy pick by log det(prior + Σ information), in the order of choice, (count,).

    The gain over the prior is monotone and submodular, so the pick has at least 1 − 1/e of the largest gain
    of any set of ``count``. Candidates are evaluated lazily: in the order of an upper bound on what they
    would reach (by the gain when last evaluated, which only shrinks, and by the criterion's tangent), until
    no bound exceeds the best value. The result is that of evaluating all of them.

    Source: Nemhauser, Wolsey, Fisher 1978 (guarantee); Minoux 1978, Accelerated greedy algorithms.
    """
    return _greedy(information, count, prior, DETERMINANT, submodular=True)


def a_optimal(
    information: Information, count: int, prior: Tensor | None = None, target: Tensor | None = None
) -> Tensor:
    """Indices of the greedy pick by tr(target · (prior + Σ information)⁻¹), in the order of choice, (count,).

    The sum of the variances is made small step by step: of the parameters, or of a target as in
    ``criteria.variance``. That is not submodular: there is no guarantee like D-optimal's, but ``ceiling``
    tells how far from the best a set can be. Without a target it depends on the parameters' units. Candidates
    are evaluated lazily, by the criterion's tangent.
    """
    return _greedy(information, count, prior, variance(target), submodular=False)


def ceiling(
    information: Information, chosen: Tensor, criterion: Criterion = DETERMINANT, prior: Tensor | None = None
) -> tuple[float, float]:
    """The criterion of a set, and what no set of as many candidates exceeds.

    That is log det(prior + Σ information), or −log of its inverse's trace with a target.

    Source: the criterion's tangent, as in the equivalence theorem of Kiefer and Wolfowitz 1960.
    """
    start, members = _set(information, chosen, prior)
    reached = start + information.stacked(members)
    weight, bound = criterion.tangent(reached)
    most = information.products(weight[None])[:, 0].topk(len(members)).values.sum() + (weight * start).sum()
    value = float(criterion.value(reached[None]))
    return value, max(value, float(bound(most)))


def _greedy(
    information: Information, count: int, prior: Tensor | None, criterion: Criterion, submodular: bool
) -> Tensor:
    total = _start(information, prior)
    if not 1 <= count <= len(information):
        raise ShapeError(f"cannot choose {count} of {len(information)} trajectories")
    gains = total.new_full((len(information),), torch.inf)
    latest, order = information.mean, list[int]()
    for _ in range(count):
        now, slack = float(criterion.value(total[None])), _slack(information, total)
        bounds = torch.minimum(now + gains, _reach(information, total, latest, criterion) + slack)
        bounds[order] = -torch.inf
        seen, values = _evaluate(bounds, partial(_with_one, criterion, information, total))
        if submodular:
            gains[seen] = values - now + slack
        best = _first_largest(seen, values)
        latest = information.matrices(slice(best, best + 1))[0]
        total = total + latest
        order.append(best)
    return torch.tensor(order, device=total.device)


def _reach(information: Information, total: Tensor, latest: Tensor, criterion: Criterion) -> Tensor:
    """Upper bounds on the criterion of ``total`` and one candidate more, (N,).

    The tangents are those at ``total`` and at what it would be with one more like the latest choice.
    """
    weights, bounds = zip(*(criterion.tangent(x) for x in (total, total + latest)))
    stacked = torch.stack(weights)
    traces = information.products(stacked) + (stacked * total).sum((1, 2))
    return torch.stack([bound(t) for bound, t in zip(bounds, traces.unbind(1))]).amin(0)


def _with_one(criterion: Criterion, information: Information, total: Tensor, indices: Tensor) -> Tensor:
    return criterion.value(total + information.matrices(indices))


def _evaluate(bounds: Tensor, value: Callable[[Tensor], Tensor]) -> tuple[Tensor, Tensor]:
    """Indices in the order of their bounds, and values, of as many as it takes to know the largest.

    Those that a bound of −∞ rules out are left out.
    """
    ranked, order = bounds.sort(descending=True, stable=True)
    order = order[ranked > -torch.inf]
    values = [bounds[:0]]
    best, done, size = -math.inf, 0, _FIRST
    while done < len(order) and float(ranked[done]) >= best - _TIE:
        values.append(value(order[done : done + size]))
        best = max(best, float(values[-1].max()))
        done, size = done + len(values[-1]), min(2 * size, _MOST)
    return order[:done], torch.cat(values)


def _first_largest(indices: Tensor, values: Tensor) -> int:
    return int(indices[values >= values.max() - _TIE].min())


def _slack(information: Information, total: Tensor) -> float:
    """Bound of what rounding does to a bound or a value of ``total`` and one matrix more."""
    spread = float(inverse(total).trace()) * (float(total.trace()) + information.largest)
    return _ROUNDING * len(total) * torch.finfo(total.dtype).eps * spread


def _start(information: Information, prior: Tensor | None) -> Tensor:
    """The prior in float64, after a look at it."""
    if not len(information):
        raise ShapeError("cannot choose of 0 trajectories")
    total = (information.prior() if prior is None else prior).to(information.packed.device, torch.float64)
    size = information.size
    if total.shape != (size, size) or not total.isfinite().all():
        raise ShapeError(f"prior is {tuple(total.shape)}, expected finite numbers ({size}, {size})")
    symmetric = torch.allclose(total, total.T, rtol=1e-9, atol=1e-12 * float(total.abs().max()))
    if not symmetric or int(torch.linalg.cholesky_ex(total).info):
        raise ShapeError("prior is not symmetric and positive definite")
    return total


def _set(information: Information, chosen: Tensor, prior: Tensor | None) -> tuple[Tensor, Tensor]:
    """The prior, and the indices of a set after a look at them."""
    start = _start(information, prior)
    information.stacked(chosen)
    if len(chosen.unique()) < len(chosen):
        raise ShapeError(f"indices are {chosen.tolist()}, expected each once")
    return start, chosen.clone()
