"""The semidefinite program behind consistent parameters: the only door to cvxpy."""

import logging
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from sidegan.errors import InfeasibleError
from sidegan.identification.sums import rows_of
from sidegan.robot.consistency import FROM_PSEUDO_INERTIA, pseudo_inertia

if TYPE_CHECKING:
    import cvxpy as cp

_log = logging.getLogger(__name__)
_OBJECTIVE_SCALES = (1e-2, 1e-4, 1.0)  # tried in turn: the solver's tolerances are absolute


@dataclass(frozen=True, eq=False)
class Task:
    """What parameters x = (links, terms) have to explain, and be.

    Attributes:
        information: A of ½ θᵀ A θ − bᵀ θ with θ = mapping · x, (P, P).
        moment: b, (P,).
        mapping: (P, 10 L + terms).
        mass: typical of each link [kg], (L,).
        length: typical of each link [m], (L,).
        nominal: link parameters to pull towards, (L, 10).
        not_negative: where x has to be.
        pull: "logdet" or "euclid".
        strength: of the pull.
        margin: smallest eigenvalue of a pseudo-inertia in its typical units.
        total_mass: of all links [kg]; free when None.
    """

    information: Tensor
    moment: Tensor
    mapping: Tensor
    mass: Tensor
    length: Tensor
    nominal: Tensor
    not_negative: Sequence[slice]
    pull: str
    strength: float
    margin: float
    total_mass: float | None


def most_likely(task: Task) -> Tensor:
    """Parameters x, (10 L + terms,), of the least misfit and pull among those that can exist.

    Raises:
        InfeasibleError: when there are none, or the solver finds none.
    """
    import cvxpy as cp

    unknowns = _Unknowns(task)
    rows, right = rows_of(task.information, task.moment)
    misfit = cp.sum_squares((rows @ task.mapping).numpy() @ unknowns.standard - right.numpy()) / 2
    objective = misfit + _pull(task, unknowns)
    for scale in _OBJECTIVE_SCALES:
        problem = cp.Problem(cp.Minimize(scale * objective), _constraints(task, unknowns))
        _run(problem)
        if problem.status not in (cp.OPTIMAL_INACCURATE, cp.SOLVER_ERROR):
            break
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        bounds = f"margin {task.margin:g}"
        bounds += "" if task.total_mass is None else f", {task.total_mass:g} kg in all"
        raise InfeasibleError(f"no bodies that can exist meet the conditions ({bounds}): {problem.status}")
    if problem.status == cp.OPTIMAL_INACCURATE:
        _log.warning("the consistent fit is less accurate than asked for")
    return torch.from_numpy(np.asarray(unknowns.standard.value, dtype=np.float64))


class _Unknowns:
    """Pseudo-inertias of the links in their typical units, terms, and x as their linear function."""

    def __init__(self, task: Task) -> None:
        import cvxpy as cp

        unit = _units(task.mass, task.length)
        self.links = [cp.Variable((4, 4), symmetric=True) for _ in task.mass]
        outer = (unit[:, :, None] * unit[:, None]).reshape(-1, 16).numpy()
        parts: list[cp.Expression] = [
            FROM_PSEUDO_INERTIA.numpy() @ cp.multiply(o, cp.vec(p, order="C"))
            for o, p in zip(outer, self.links)
        ]
        count = task.mapping.shape[1] - 10 * len(task.mass)
        if count:
            parts.append(cp.Variable(count))
        self.standard = cp.hstack(parts)
        self.mass = sum(m * p[3, 3] for m, p in zip(task.mass.tolist(), self.links))


def _pull(task: Task, unknowns: _Unknowns) -> "cp.Expression":
    import cvxpy as cp

    nominal = _scaled(task.nominal, task.mass, task.length).numpy()
    if task.pull == "euclid":
        return task.strength * sum(cp.sum_squares(p - p0) for p, p0 in zip(unknowns.links, nominal))
    inverses = np.linalg.inv(nominal)
    return task.strength * sum(cp.trace(i @ p) - cp.log_det(p) for i, p in zip(inverses, unknowns.links))


def _constraints(task: Task, unknowns: _Unknowns) -> "list[cp.Constraint]":
    constraints = [p >> task.margin * np.eye(4) for p in unknowns.links]
    constraints += [unknowns.standard[where] >= 0 for where in task.not_negative]
    if task.total_mass is not None:
        constraints.append(unknowns.mass == task.total_mass)
    return constraints


def _run(problem: "cp.Problem") -> None:
    import cvxpy as cp

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about accuracy, which the status tells
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError as error:
            _log.info("Clarabel: %s", error)


def least_eigenvalues(links: Tensor, mass: Tensor, length: Tensor) -> Tensor:
    """Smallest eigenvalue of each link's pseudo-inertia in units of its mass and length, (L,).

    Args:
        links: link parameters, (L, 10).
        mass: typical of each link [kg], (L,).
        length: typical of each link [m], (L,).
    """
    return torch.linalg.eigvalsh(_scaled(links, mass, length))[:, 0]


def _scaled(links: Tensor, mass: Tensor, length: Tensor) -> Tensor:
    """Pseudo-inertias (L, 4, 4) in units of masses and lengths: D⁻¹ P D⁻¹."""
    unit = 1 / _units(mass, length)
    return pseudo_inertia(links) * unit[:, :, None] * unit[:, None]


def _units(mass: Tensor, length: Tensor) -> Tensor:
    """Diagonal of D, (L, 4): √m (l, l, l, 1)."""
    one = torch.ones_like(length)
    return mass.sqrt()[:, None] * torch.stack([length, length, length, one], 1)
