"""Parameters of an arm that can exist: the physically consistent fit, and the only door to cvxpy."""

import logging
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidegan.errors import InfeasibleError
from sidegan.identification.accuracy import torque_errors
from sidegan.identification.fit import Fit, reweighted
from sidegan.identification.gather import Gathered
from sidegan.identification.model import TorqueModel
from sidegan.identification.prior import scales
from sidegan.identification.sums import rows_of, solve
from sidegan.robot import Arm, possible_links
from sidegan.robot.consistency import FROM_PSEUDO_INERTIA, pseudo_inertia

if TYPE_CHECKING:
    import cvxpy as cp

_log = logging.getLogger(__name__)
_LEAST = 1e-6  # information on what neither samples nor pull determine, and on terms
_MARGIN = 1e-4  # smallest eigenvalue of a pseudo-inertia in its link's typical mass and length
_ROUNDS = 6  # of finding the strength of the pull
_SETTLED = 1.1  # times the strength: a change that no longer matters
_STRENGTHS = (0.01, 100.0)  # between which it is looked for
_BELIEVED = 1.0  # of a link's ten parameters: as much says beforehand that its strength is the others'
_OBJECTIVE_SCALES = (1e-2, 1e-4, 1.0)  # tried in turn: the solver's tolerances are absolute


@dataclass(frozen=True, kw_only=True)
class Consistent:
    """The most likely parameters of an arm that can exist.

    min over links' pseudo-inertias P_i and terms x of ½ θᵀ A θ − bᵀ θ + Σ strength_i d(P_i, P_i⁰) with θ the
    model's parameters and d the divergence from the description's pseudo-inertias, which depends on neither
    units nor frames; P_i are positive definite, friction and rotor inertias not negative. In the covariance
    the pull's second derivative counts as information beside the samples'; bounds would only make it smaller.

    Source: Wensing et al. 2018; Sousa, Cortesão 2014; Lee, Wensing, Park 2020, Geometric robot dynamic
    identification: a convex programming approach, eq. 22.
    """

    # weight of the pull beside the samples' log-likelihood; it chooses among parameters that no motion tells.
    # None: each link's most probable one, so that a link that the samples contradict is pulled less
    strength: float | None = None

    def fit(self, data: Gathered) -> Fit:
        """Most likely parameters of an arm that can exist, with links and terms as ``standard``."""
        model = data.model
        first = reweighted(data.sums, _LEAST)
        errors = torque_errors(data, first)
        weights = first.weights / errors.inflation.sqrt()  # with which samples count beside the pull
        information, moment = data.sums.weighted(weights)
        standard, pull = self.standard(model, information, moment)
        prior = _pull_information(model, standard, pull)
        _, inverse = solve(information + prior, moment, _LEAST)
        return Fit(model.mapping @ standard, inverse, weights, prior, standard, errors)

    def standard(self, model: TorqueModel, information: Tensor, moment: Tensor) -> "tuple[Tensor, Pull]":
        """Most likely parameters from weighted Σ Yᵀ Y and Σ Yᵀ τ, and the pull on each link.

        Links and terms are in ``TorqueModel.standard_names``' order, (F,).
        """
        (rows, right), unit = rows_of(information, moment), _units(model.arm)
        signed = [model.standard_slice(name) for name in model.kinds if name != "offset"]
        alike = torch.full((model.joints,), self.strength or 1.0, dtype=torch.float64)
        pull = Pull(unit, _scaled(possible_links(model.arm), unit), alike)
        found = most_likely(rows @ model.mapping, right, pull, signed)
        for _ in range(_ROUNDS if self.strength is None else 0):
            before, pull = pull, pull._replace(strength=_most_probable(model, information, found, pull))
            found = most_likely(rows @ model.mapping, right, pull, signed)
            if ((pull.strength / before.strength).log().abs() < math.log(_SETTLED)).all():
                break
        return found, pull


class Pull(NamedTuple):
    """Pull of K bodies towards nominal ones."""

    unit: Tensor  # D as in ``_units``, (K, 4)
    nominal: Tensor  # pseudo-inertias in these units, (K, 4, 4)
    strength: Tensor  # on each, (K,)

    def distances(self, bodies: Tensor) -> tuple[Tensor, Tensor]:
        """Distances of bodies (K, 10) from the nominal ones, (K,), and second derivatives, (K, 10, 10)."""
        axes = torch.eye(10, dtype=torch.float64).expand(len(bodies), 10, 10)
        steps = torch.stack([_scaled(axes[:, k], self.unit) for k in range(10)], 1)  # (K, 10, 4, 4)
        now = _scaled(bodies, self.unit)
        ratio = torch.linalg.solve(self.nominal, now)
        distances = ratio.diagonal(dim1=1, dim2=2).sum(1) - 4 - torch.logdet(ratio)
        steps = torch.linalg.solve(now[:, None], steps)
        return distances, torch.einsum("kaxy,kbyx->kab", steps, steps)


def _pull_information(model: TorqueModel, standard: Tensor, pull: Pull) -> Tensor:
    """Information on the model's parameters, (P, P), that the pull adds at standard ones, (F,).

    It is on links alone. What the model does not separate in a link has the spread that the pull leaves.
    """
    _, bend = pull.distances(model.links_of(standard))
    free = torch.full((len(standard) - 10 * len(bend),), 1 / _LEAST, dtype=torch.float64)
    links = torch.linalg.inv(pull.strength[:, None, None] * bend)
    spread = model.mapping @ torch.block_diag(*links, free.diag()) @ model.mapping.T
    unit = spread.diagonal().sqrt()  # parameters differ by orders of magnitude
    return torch.linalg.inv(spread / unit[:, None] / unit) / unit[:, None] / unit


def _most_probable(model: TorqueModel, information: Tensor, standard: Tensor, pull: Pull) -> Tensor:
    """Strengths (J,) that the samples make most probable, from the parameters (F,) found with others.

    Of a link's parameters, the pull and not the samples determines γ; strength · 2 d = γ then says
    that these are off by what was believed. A link that is hardly determined is pulled like the others.

    Source: MacKay 1992, Bayesian interpolation, eq. 27; MacKay 1994, Bayesian non-linear modeling, for a
    strength of each group of parameters; with a gamma distribution about the others' strength before.
    """
    distances, bend = pull.distances(model.links_of(standard))
    own = torch.block_diag(*(pull.strength[:, None, None] * bend))
    count, size = len(standard), len(own)
    both = model.mapping.T @ information @ model.mapping + _LEAST * torch.diag(torch.arange(count) >= size)
    both[:size, :size] += own
    left = torch.linalg.solve(both, torch.eye(count, size, dtype=torch.float64))[:size]
    determined = 10 - (left @ own).diagonal().view(-1, 10).sum(1)
    usual = pull.strength.log().mean().exp()
    return ((determined + _BELIEVED) / (2 * distances + _BELIEVED / usual)).clamp(*_STRENGTHS)


def most_likely(rows: Tensor, right: Tensor, pull: Pull, signed: Sequence[slice] = ()) -> Tensor:
    """Parameters x of K bodies that can exist and then of terms, (F,), with least ½ |R x − z|² and pulls.

    Terms at ``signed`` places are not negative.

    Raises:
        InfeasibleError: when the solver finds no such bodies.
    """
    import cvxpy as cp

    unit, nominal, strength = pull
    bodies = [cp.Variable((4, 4), symmetric=True) for _ in unit]  # pseudo-inertias in typical units
    outer, back = (unit[:, :, None] * unit[:, None]).reshape(-1, 16).numpy(), FROM_PSEUDO_INERTIA.numpy()
    parts: list[cp.Expression] = [back @ cp.multiply(o, cp.vec(p, order="C")) for o, p in zip(outer, bodies)]
    terms = rows.shape[1] - 10 * len(bodies)
    x = cp.hstack([*parts, cp.Variable(terms)] if terms else parts)
    constraints = [p >> _MARGIN * np.eye(4) for p in bodies] + [x[where] >= 0 for where in signed]
    each = zip(strength.tolist(), torch.linalg.inv(nominal).numpy(), bodies)
    pulls = sum(one * (cp.trace(inverse @ p) - cp.log_det(p)) for one, inverse, p in each)
    status = _minimise(cp.sum_squares(rows.numpy() @ x - right.numpy()) / 2 + pulls, constraints)
    if status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise InfeasibleError(f"no bodies that can exist explain the samples: {status}")
    found = torch.from_numpy(np.asarray(x.value, dtype=np.float64))
    if not (torch.linalg.eigvalsh(_scaled(found[: 10 * len(bodies)].view(-1, 10), unit)) > 0).all():
        raise InfeasibleError("the solver left a link that cannot exist: a stronger pull may help")
    return found


def _units(arm: Arm) -> Tensor:
    """Diagonal √m (l, l, l, 1) of D, (J, 4): D⁻¹ P D⁻¹ is a pseudo-inertia in its link's typical units."""
    mass, length = scales(arm)
    return mass.sqrt()[:, None] * torch.stack([length, length, length, torch.ones_like(length)], 1)


def _scaled(links: Tensor, unit: Tensor) -> Tensor:
    """Pseudo-inertias (J, 4, 4) of links (J, 10) in units (J, 4)."""
    inverse = 1 / unit
    return pseudo_inertia(links) * inverse[:, :, None] * inverse[:, None]


def _minimise(objective: "cp.Expression", constraints: "list[cp.Constraint]") -> str:
    """Status of the best that Clarabel found, which the variables hold."""
    import cvxpy as cp

    status = cp.SOLVER_ERROR
    for scale in _OBJECTIVE_SCALES:
        problem = cp.Problem(cp.Minimize(scale * objective), constraints)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about accuracy, which the status has
            try:
                problem.solve(solver=cp.CLARABEL)
                status = str(problem.status)
            except cp.error.SolverError as error:  # leaves status and variables as they were
                _log.info("Clarabel: %s", error)
        if status not in (cp.OPTIMAL_INACCURATE, cp.SOLVER_ERROR):
            break
    if status == cp.OPTIMAL_INACCURATE:
        _log.warning("the consistent fit is less accurate than asked for")
    return status
