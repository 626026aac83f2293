"""Parameters of an arm that can exist: the physically consistent fit."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ConfigError, InfeasibleError, RobotError
from sidegan.identification.fit import Fit, positive
from sidegan.identification.gather import Gathered, Linear
from sidegan.identification.inertia import least_eigenvalues
from sidegan.identification.linear import Ols
from sidegan.identification.model import Model
from sidegan.identification.prior import likelihood, scales
from sidegan.identification.program import Task, most_likely
from sidegan.identification.sums import solve

_PULLS = ("logdet", "euclid")
_NOT_NEGATIVE = ("rotor_inertia", "viscous", "coulomb", "stribeck")


class Consistent(NamedTuple):
    """Physically consistent parameters.

    Attributes:
        inertial: link parameters in Pinocchio's order, (J, 10); every pseudo-inertia is positive definite.
        terms: parameters of each term of the model, (J,).
        parameters: the model's θ that follows from both, (P,).
        standard: both in ``Model.standard_names``' order, (F,).
    """

    inertial: Tensor
    terms: dict[str, Tensor]
    parameters: Tensor
    standard: Tensor


@dataclass(frozen=True)
class Conditions:
    """What consistent parameters have to meet, and what they are pulled towards.

    Attributes:
        pull: ``"logdet"``: the divergence of pseudo-inertias from the description's (Lee et al. 2020), which
            does not depend on units or frames and keeps away from the border; ``"euclid"``: the squared
            distance in each link's typical units, which also takes a description that is not consistent.
        strength: weight of the pull beside the samples' log-likelihood, above zero: it has to choose among
            parameters that no motion tells apart.
        margin: smallest eigenvalue of a pseudo-inertia in the link's typical mass and length.
        total_mass: of all links together [kg]; free when None.

    Raises:
        ConfigError: when a value is impossible.
    """

    pull: str = "logdet"
    strength: float = 1.0
    margin: float = 1e-4
    total_mass: float | None = None

    def __post_init__(self) -> None:
        if self.pull not in _PULLS:
            raise ConfigError(f"pull is {self.pull!r}, expected one of {', '.join(_PULLS)}")
        positive("strength", self.strength)
        positive("margin", self.margin)
        if self.total_mass is not None:
            positive("total_mass", self.total_mass)


def consistent(
    model: Model, information: Tensor, moment: Tensor, conditions: Conditions | None = None
) -> Consistent:
    """The most likely parameters of an arm that can exist.

    min over links' pseudo-inertias P_i and terms x of ½ θᵀ A θ − bᵀ θ + strength Σ d(P_i, P_i⁰) with θ the
    model's parameters, P_i ⪰ margin, and friction and rotor inertias not negative.

    Args:
        model: of the arm, whose description is what is pulled towards.
        information: A, (P, P): weighted Σ Yᵀ Y, as ``Estimate.information``.
        moment: b, (P,): weighted Σ Yᵀ τ, as ``Estimate.moment``.
        conditions: see ``Conditions``.

    Raises:
        RobotError: when the pull needs a consistent description and a link of it is not; names the links.
        InfeasibleError: when no parameters meet the conditions, or the solver finds none.
        ConfigError: when no link has a mass in the description.

    Source: Wensing et al. 2018; Sousa, Cortesão 2014; Lee, Wensing, Park 2020, Geometric robot dynamic
    identification: a convex programming approach, eq. 22.
    """
    conditions = conditions or Conditions()
    _check(model, conditions)
    mass, length = scales(model.arm)
    task = Task(
        information=information,
        moment=moment,
        mapping=model.mapping,
        mass=mass,
        length=length,
        nominal=model.arm.inertial_parameters,
        not_negative=[model.standard_slice(name) for name in model.kinds if name in _NOT_NEGATIVE],
        **vars(conditions),
    )
    standard = most_likely(task)
    links = standard[: 10 * model.joints].reshape(-1, 10)
    if not (least_eigenvalues(links, mass, length) > 0).all():
        raise InfeasibleError("the solver left a link that cannot exist; a larger margin may help")
    terms = {name: standard[model.standard_slice(name)] for name in model.kinds}
    return Consistent(links, terms, model.mapping @ standard, standard)


@dataclass(frozen=True)
class ConsistentFit(Ols):
    """The physically consistent fit as an estimator; settings are those of ``Conditions``.

    The covariance given is that of weighted least squares, which consistency can only make smaller.
    """

    pull: str = "logdet"
    strength: float = 1.0
    margin: float = 1e-4
    total_mass: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._conditions()

    def _conditions(self) -> Conditions:
        return Conditions(self.pull, self.strength, self.margin, self.total_mass)

    def fit(self, model: Linear, gathered: Gathered) -> Fit:
        """Most likely parameters of an arm that can exist."""
        if not isinstance(model, Model):
            raise ConfigError("the consistent fit is of a whole arm: it needs a Model")
        weights, errors = likelihood(model, gathered, self.prior)
        information, moment = gathered.sums.weighted(weights)
        found = consistent(model, information, moment, self._conditions())
        _, inverse = solve(information, moment, 1 / self.prior)
        flat = torch.eye(model.count, dtype=torch.float64) / self.prior
        return Fit(found.parameters, inverse, weights, flat, None, None, found.standard, errors)


def _check(model: Model, conditions: Conditions) -> None:
    mass, length = scales(model.arm)
    least = least_eigenvalues(model.arm.inertial_parameters, mass, length)
    bad = [model.arm.joint_names[i] for i in (least <= 0).nonzero()[:, 0].tolist()]
    if bad and conditions.pull == "logdet":
        raise RobotError(
            f"the description of {model.arm.name} is not physically consistent at the links of "
            f"{', '.join(bad)}: pull='euclid' takes it all the same"
        )
