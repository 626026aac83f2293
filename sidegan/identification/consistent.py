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
_ROUNDS = 6  # of finding the strength of the pull
_SETTLED = 1.1  # times the strength: a change that no longer matters
_STRENGTHS = (0.01, 100.0)  # between which it is looked for
_BELIEVED = 1.0  # of a link's ten parameters: as much says beforehand that its strength is the others'
_FREE = 1e-6  # information on each term beside the samples'
_OBJECTIVE_SCALES = (1e-2, 1e-4, 1.0)  # tried in turn: the solver's tolerances are absolute


@dataclass(frozen=True, kw_only=True)
class Consistent:
    """The most likely parameters of an arm that can exist.

    min over links' pseudo-inertias P_i and terms x of ½ θᵀ A θ − bᵀ θ + Σ strength_i d(P_i, P_i⁰) with θ the
    model's parameters, d the divergence of pseudo-inertias from the description's, which depends on neither
    units nor frames, P_i ⪰ margin, and friction and rotor inertias not negative. The covariance is its own:
    the pull's second derivative at the fit counts as information beside the samples'. Bounds that are reached
    would only make it smaller.

    Source: Wensing et al. 2018; Sousa, Cortesão 2014; Lee, Wensing, Park 2020, Geometric robot dynamic
    identification: a convex programming approach, eq. 22.
    """

    # weight of the pull beside the samples' log-likelihood; it chooses among parameters that no motion tells.
    # None: each link's most probable one, so that a link that the samples contradict is pulled less
    strength: float | None
    margin: float  # smallest eigenvalue of a pseudo-inertia in the link's typical mass and length
    total_mass: float | None  # of all links together [kg]; free when None
    prior: float = 1e6  # P₀ = prior · I of what neither samples nor pull determine

    def fit(self, data: Gathered) -> Fit:
        """Most likely parameters of an arm that can exist, with links and terms as ``standard``."""
        model = data.model
        first = reweighted(data.sums, 1 / self.prior)
        errors = torque_errors(data, first)
        weights = first.weights / errors.inflation.sqrt()  # with which samples count beside the pull
        information, moment = data.sums.weighted(weights)
        standard, strength = self.standard(model, information, moment)
        prior = self._pull_information(model, standard, strength)
        _, inverse = solve(information + prior, moment, 1 / self.prior)
        return Fit(model.mapping @ standard, inverse, weights, prior, standard, errors)

    def standard(self, model: TorqueModel, information: Tensor, moment: Tensor) -> tuple[Tensor, Tensor]:
        """Most likely parameters from weighted Σ Yᵀ Y and Σ Yᵀ τ, and the strength of the pull on each link.

        Links and terms are in ``TorqueModel.standard_names``' order, (F,); strengths are (J,).
        """
        strength = torch.full((model.joints,), self.strength or 1.0, dtype=torch.float64)
        found = self._solved(model, information, moment, strength)
        for _ in range(_ROUNDS if self.strength is None else 0):
            before, strength = strength, self._most_probable(model, information, found, strength)
            found = self._solved(model, information, moment, strength)
            if ((strength / before).log().abs() < math.log(_SETTLED)).all():
                break
        _log.debug("the description pulls its links with strengths %s", strength)
        return found, strength

    def _pull_information(self, model: TorqueModel, standard: Tensor, strength: Tensor) -> Tensor:
        """Information on the model's parameters, (P, P), that the pull adds at parameters (F,).

        It is on links alone. What the model does not separate in a link has the spread that the pull leaves.
        """
        _, bend = self._distances(model.links_of(standard), model.arm)
        free = torch.full((len(standard) - bend[:, 0].numel(),), self.prior, dtype=torch.float64)
        links = torch.linalg.inv(strength[:, None, None] * bend)
        spread = model.mapping @ torch.block_diag(*links, free.diag()) @ model.mapping.T
        unit = spread.diagonal().sqrt()  # parameters differ by orders of magnitude
        return torch.linalg.inv(spread / unit[:, None] / unit) / unit[:, None] / unit

    def _most_probable(
        self, model: TorqueModel, information: Tensor, standard: Tensor, strength: Tensor
    ) -> Tensor:
        """Strengths (J,) that the samples make most probable, from the parameters (F,) found with others.

        Of a link's parameters, the pull and not the samples determines γ; strength · 2 d = γ then says
        that these are off by what was believed. A link that is hardly determined is pulled like the others.

        Source: MacKay 1992, Bayesian interpolation, eq. 27; MacKay 1994, Bayesian non-linear modeling, for a
        strength of each group of parameters; with a gamma distribution about the others' strength before.
        """
        distances, bend = self._distances(model.links_of(standard), model.arm)
        pull = torch.block_diag(*(strength[:, None, None] * bend))
        count, size = len(standard), len(pull)
        both = model.mapping.T @ information @ model.mapping + _FREE * torch.diag(torch.arange(count) >= size)
        both[:size, :size] += pull
        left = torch.linalg.solve(both, torch.eye(count, size, dtype=torch.float64))[:size]
        determined = 10 - (left @ pull).diagonal().view(-1, 10).sum(1)
        usual = strength.log().mean().exp()
        return ((determined + _BELIEVED) / (2 * distances + _BELIEVED / usual)).clamp(*_STRENGTHS)

    def _distances(self, links: Tensor, arm: Arm) -> tuple[Tensor, Tensor]:
        """Distances of links (J, 10) from where the pull leads, (J,), and second derivatives, (J, 10, 10)."""
        unit, axes = _units(arm), torch.eye(10, dtype=torch.float64).expand(len(links), 10, 10)
        steps = torch.stack([_scaled(axes[:, k], unit) for k in range(10)], 1)  # (J, 10, 4, 4)
        now, nominal = _scaled(links, unit), _scaled(possible_links(arm), unit)
        ratio = torch.linalg.solve(nominal, now)
        distances = ratio.diagonal(dim1=1, dim2=2).sum(1) - 4 - torch.logdet(ratio)
        steps = torch.linalg.solve(now[:, None], steps)
        return distances, torch.einsum("jaxy,jbyx->jab", steps, steps)

    def _solved(self, model: TorqueModel, information: Tensor, moment: Tensor, strength: Tensor) -> Tensor:
        """Most likely standard parameters, (F,), with pulls of a strength on each link, (J,)."""
        rows, right = rows_of(information, moment)
        unit = _units(model.arm)
        signed = [model.standard_slice(name) for name in model.kinds if name != "offset"]
        pull = Pull(unit, _scaled(possible_links(model.arm), unit), strength)
        return most_likely(rows @ model.mapping, right, pull, self.margin, signed, self.total_mass)


class Pull(NamedTuple):
    """Pull of K bodies towards nominal ones."""

    unit: Tensor  # D as in ``_units``, (K, 4)
    nominal: Tensor  # pseudo-inertias in these units, (K, 4, 4)
    strength: Tensor  # on each, (K,)


def most_likely(
    rows: Tensor,
    right: Tensor,
    pull: Pull,
    margin: float,
    signed: Sequence[slice] = (),
    total_mass: float | None = None,
) -> Tensor:
    """Parameters x of K bodies that can exist and then of terms, (F,), with least ½ |R x − z|² and pulls.

    Terms at ``signed`` places are not negative.

    Raises:
        InfeasibleError: when there are no such bodies.
    """
    import cvxpy as cp

    unit, nominal, strength = pull
    bodies = [cp.Variable((4, 4), symmetric=True) for _ in unit]  # pseudo-inertias in typical units
    outer, back = (unit[:, :, None] * unit[:, None]).reshape(-1, 16).numpy(), FROM_PSEUDO_INERTIA.numpy()
    parts: list[cp.Expression] = [back @ cp.multiply(o, cp.vec(p, order="C")) for o, p in zip(outer, bodies)]
    terms = rows.shape[1] - 10 * len(bodies)
    x = cp.hstack([*parts, cp.Variable(terms)] if terms else parts)
    constraints = [p >> margin * np.eye(4) for p in bodies] + [x[where] >= 0 for where in signed]
    if total_mass is not None:
        constraints.append(cp.sum(x[: 10 * len(bodies) : 10]) == total_mass)
    each = zip(strength.tolist(), torch.linalg.inv(nominal).numpy(), bodies)
    pulls = sum(one * (cp.trace(inverse @ p) - cp.log_det(p)) for one, inverse, p in each)
    status = _minimise(cp.sum_squares(rows.numpy() @ x - right.numpy()) / 2 + pulls, constraints)
    if status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        bounds = f"margin {margin:g}" + ("" if total_mass is None else f", {total_mass:g} kg in all")
        raise InfeasibleError(f"no bodies that can exist meet the conditions ({bounds}): {status}")
    found = torch.from_numpy(np.asarray(x.value, dtype=np.float64))
    if not (torch.linalg.eigvalsh(_scaled(found[: 10 * len(bodies)].view(-1, 10), unit)) > 0).all():
        raise InfeasibleError("the solver left a link that cannot exist; a larger margin may help")
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
