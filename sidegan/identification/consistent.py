"""The physically consistent fit. Only this module imports cvxpy."""

import logging
import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array, geometric_mean
from sidegan.errors import InfeasibleError
from sidegan.identification.fit import LEAST, Fit, Gathered, torque_errors, weighted_least_squares
from sidegan.identification.model import TorqueModel, scales
from sidegan.identification.sums import rows_of, solve
from sidegan.robot import possible_links
from sidegan.robot.consistency import FROM_PSEUDO_INERTIA, pseudo_inertia

if TYPE_CHECKING:
    import cvxpy as cp

_log = logging.getLogger(__name__)
_MARGIN = 1e-4  # smallest eigenvalue of a pseudo-inertia in its link's typical mass and length
_ROUNDS = 6  # iterations of the strength of the pull
_SETTLED = 1.1  # ratio of successive strengths below which they have converged
_STRENGTHS = (0.01, 100.0)  # bounds of the strength
_BELIEVED = 1.0  # parameters' worth of prior belief that a link's strength is the others'
# tried in turn: the solver's tolerances are absolute, and residuals far above the noise make huge objectives
_OBJECTIVE_SCALES = (1e-2, 1e-4, 1.0, 1e-6, 1e-8)


def consistent(model: TorqueModel, data: Gathered, strength: float | None = None) -> Fit:
    """The most likely physically consistent parameters; links and terms are in ``standard``.

    min over links' pseudo-inertias P_i and terms x of ½ θᵀ A θ − bᵀ θ + Σ strength_i d(P_i, P_i⁰) with θ the
    model's parameters and d the divergence from the description's pseudo-inertias, which depends on neither
    units nor frames. P_i are positive definite; friction and rotor inertias are not negative. The covariance
    counts the pull's second derivative as information; it neglects the bounds, which would only reduce it.

    ``strength`` is the weight of the pull relative to the log-likelihood of the samples; it decides the
    parameters that no motion identifies. None: the most probable strength of each link, which pulls a link
    less if the samples contradict it.

    Source: Wensing et al. 2018; Sousa, Cortesão 2014; Lee, Wensing, Park 2020, Geometric robot dynamic
    identification: a convex programming approach, eq. 22.
    """
    first = weighted_least_squares(data.sums)
    errors = torque_errors(model, data, first)
    weights = first.weights / np.sqrt(errors.inflation)  # as independent samples, to compare with the pull
    information, moment = data.sums.weighted(weights)
    standard, pull = fit_with_pull(model, information, moment, strength)
    prior = _pull_information(model, standard, pull)
    _, inverse = solve(information + prior, moment, LEAST)
    return Fit(model.mapping @ standard, inverse, weights, prior, standard, errors)


def fit_with_pull(
    model: TorqueModel, information: Array, moment: Array, strength: float | None = None
) -> "tuple[Array, Pull]":
    """Most likely parameters from weighted Σ Yᵀ Y and Σ Yᵀ τ, and the pull on each link.

    Links and terms are in ``TorqueModel.standard_names``' order, (F,).
    """
    rows, right = rows_of(information, moment)
    mass, length = scales(model.arm)
    unit = np.sqrt(mass)[:, None] * np.stack([length, length, length, np.ones_like(length)], 1)
    signed = [model.standard_slice(name) for name in model.kinds if name != "offset"]
    pull = Pull(unit, _scaled(possible_links(model.arm), unit), np.full(model.joints, strength or 1.0))
    found = most_likely(rows @ model.mapping, right, pull, signed)
    for _ in range(_ROUNDS if strength is None else 0):
        before = pull
        pull = pull._replace(strength=_most_probable(model, information, found, pull))
        found = most_likely(rows @ model.mapping, right, pull, signed)
        if (np.abs(np.log(pull.strength / before.strength)) < math.log(_SETTLED)).all():
            break
    return found, pull


class Pull(NamedTuple):
    """A penalty that pulls K bodies towards nominal ones."""

    unit: Array  # diagonals √m (l, l, l, 1) of D: D⁻¹ P D⁻¹ is a pseudo-inertia in typical units, (K, 4)
    nominal: Array  # pseudo-inertias in these units, (K, 4, 4)
    strength: Array  # weight of each body's penalty, (K,)

    def distances(self, bodies: Array) -> tuple[Array, Array]:
        """Distances of bodies (K, 10) from the nominal ones, (K,), and second derivatives, (K, 10, 10)."""
        now = _scaled(bodies, self.unit)
        ratio = np.linalg.solve(self.nominal, now)
        distances = ratio.trace(axis1=1, axis2=2) - 4 - np.linalg.slogdet(ratio).logabsdet
        steps = np.linalg.solve(now[:, None], _scaled(np.eye(10), self.unit[:, None]))  # (K, 10, 4, 4)
        return distances, np.einsum("kaxy,kbyx->kab", steps, steps)


def _pull_information(model: TorqueModel, standard: Array, pull: Pull) -> Array:
    """Information that the pull adds on the model's parameters, (P, P), at standard ones, (F,).

    Only links are pulled. Link parameters that the model does not separate have the pull's own spread.
    """
    _, bend = pull.distances(model.links_of(standard))
    free = np.eye(len(standard) - 10 * len(bend)) / LEAST
    links = np.linalg.inv(pull.strength[:, None, None] * bend)
    spread = model.mapping @ scipy.linalg.block_diag(*links, free) @ model.mapping.T
    unit = np.sqrt(spread.diagonal())  # parameters differ by orders of magnitude
    return np.linalg.inv(spread / unit[:, None] / unit) / unit[:, None] / unit


def _most_probable(model: TorqueModel, information: Array, standard: Array, pull: Pull) -> Array:
    """Most probable strengths (J,) given the samples, from the parameters (F,) found with earlier strengths.

    γ is the number of a link's parameters that the samples determine. The strength with strength · 2 d = γ
    makes their distance from nominal the expected one. A link that is hardly determined is pulled like the
    others.

    Source: MacKay 1992, Bayesian interpolation, eq. 27; MacKay 1994, Bayesian non-linear modeling, for one
    strength per group of parameters; here with a gamma prior around the others' strength.
    """
    distances, bend = pull.distances(model.links_of(standard))
    prior = scipy.linalg.block_diag(*(pull.strength[:, None, None] * bend))
    count, size = len(standard), len(prior)
    total = model.mapping.T @ information @ model.mapping + LEAST * np.diag(np.arange(count) >= size)
    total[:size, :size] += prior
    inverse = np.linalg.solve(total, np.eye(count, size))[:size]
    determined = 10 - (inverse @ prior).diagonal().reshape(-1, 10).sum(1)
    usual = geometric_mean(pull.strength)
    return np.clip((determined + _BELIEVED) / (2 * distances + _BELIEVED / usual), *_STRENGTHS)


def most_likely(rows: Array, right: Array, pull: Pull, signed: Sequence[slice] = ()) -> Array:
    """Parameters x, (F,), of K physically consistent bodies, then of terms: minimise ½ |R x − z|² + pulls.

    Terms in the ``signed`` slices are not negative.
    """
    import cvxpy as cp

    unit, nominal, strength = pull
    bodies = [cp.Variable((4, 4), symmetric=True) for _ in unit]  # pseudo-inertias in typical units
    outer = (unit[:, :, None] * unit[:, None]).reshape(-1, 16)
    parts: list[cp.Expression] = [
        FROM_PSEUDO_INERTIA @ cp.multiply(o, cp.vec(p, order="C")) for o, p in zip(outer, bodies)
    ]
    terms = rows.shape[1] - 10 * len(bodies)
    x = cp.hstack([*parts, cp.Variable(terms)] if terms else parts)
    constraints = [p >> _MARGIN * np.eye(4) for p in bodies] + [x[where] >= 0 for where in signed]
    each = zip(strength.tolist(), np.linalg.inv(nominal), bodies)
    pulls = sum(weight * (cp.trace(inverse @ p) - cp.log_det(p)) for weight, inverse, p in each)
    status = _minimise(cp.sum_squares(rows @ x - right) / 2 + pulls, constraints)
    if status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise InfeasibleError(f"no physically possible links explain the samples: {status}")
    found = np.asarray(x.value)
    if not (np.linalg.eigvalsh(_scaled(found[: 10 * len(bodies)].reshape(-1, 10), unit)) > 0).all():
        raise InfeasibleError("the solver left a physically impossible link: a stronger pull may help")
    return found


def _scaled(links: Array, unit: Array) -> Array:
    """Pseudo-inertias (…, 4, 4) of links (…, 10) in units (…, 4)."""
    return pseudo_inertia(links) / unit[..., :, None] / unit[..., None, :]


def _minimise(objective: "cp.Expression", constraints: "list[cp.Constraint]") -> str:
    """Solve with Clarabel, which sets the variables; the solution's status."""
    import cvxpy as cp

    status = cp.SOLVER_ERROR
    for scale in _OBJECTIVE_SCALES:
        problem = cp.Problem(cp.Minimize(scale * objective), constraints)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about accuracy: the status says the same
            try:
                problem.solve(solver=cp.CLARABEL)
                status = str(problem.status)
            except cp.error.SolverError as error:  # status and variables keep the previous attempt's values
                _log.debug("Clarabel: %s", error)
        if status not in (cp.OPTIMAL_INACCURATE, cp.SOLVER_ERROR):
            break
    if status == cp.OPTIMAL_INACCURATE:
        _log.warning("the consistent fit is less accurate than requested")
    return status
