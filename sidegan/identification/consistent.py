"""Parameters of an arm that can exist: the physically consistent fit."""

from dataclasses import dataclass, fields

from torch import Tensor

from sidegan.errors import ConfigError, InfeasibleError, RobotError
from sidegan.identification.fit import Fit, flat, positive
from sidegan.identification.gather import Gathered
from sidegan.identification.linear import Ols
from sidegan.identification.model import TorqueModel
from sidegan.identification.prior import arm_model, likelihood, scales
from sidegan.identification.program import Task, least_eigenvalues, most_likely
from sidegan.identification.sums import solve

_PULLS = ("logdet", "euclid")
_NOT_NEGATIVE = ("rotor_inertia", "viscous", "coulomb", "stribeck")


@dataclass(frozen=True)
class Consistent(Ols):
    """The most likely parameters of an arm that can exist.

    min over links' pseudo-inertias P_i and terms x of ½ θᵀ A θ − bᵀ θ + strength Σ d(P_i, P_i⁰) with θ the
    model's parameters, P_i ⪰ margin, and friction and rotor inertias not negative. The covariance given is
    that of weighted least squares, which consistency can only make smaller.

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

    Source: Wensing et al. 2018; Sousa, Cortesão 2014; Lee, Wensing, Park 2020, Geometric robot dynamic
    identification: a convex programming approach, eq. 22.
    """

    pull: str = "logdet"
    strength: float = 1.0
    margin: float = 1e-4
    total_mass: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.pull not in _PULLS:
            raise ConfigError(f"pull is {self.pull!r}, expected one of {', '.join(_PULLS)}")
        positive("strength", self.strength)
        positive("margin", self.margin)
        if self.total_mass is not None:
            positive("total_mass", self.total_mass)

    def fit(self, data: Gathered) -> Fit:
        """Most likely parameters of an arm that can exist, with links and terms as ``standard``.

        Raises:
            RobotError: when the pull needs a consistent description and a link of it is not; names the links.
            InfeasibleError: when no parameters meet the conditions, or the solver finds none.
            ConfigError: when the model is not one of an arm, or no link has a mass in its description.
        """
        model = arm_model(data, "the consistent fit is of a whole arm")
        weights, errors = likelihood(data, self.prior)
        information, moment = data.sums.weighted(weights)
        standard = self.standard(model, information, moment)
        _, inverse = solve(information, moment, 1 / self.prior)
        prior = flat(model.count, 1 / self.prior)
        return Fit(model.mapping @ standard, inverse, weights, prior, standard, errors)

    def standard(self, model: TorqueModel, information: Tensor, moment: Tensor) -> Tensor:
        """Links and terms in ``TorqueModel.standard_names``' order, (F,), from weighted Σ Yᵀ Y and Σ Yᵀ τ."""
        mass, length = scales(model.arm)
        nominal = model.arm.inertial_parameters
        if self.pull == "logdet":
            least = least_eigenvalues(nominal, mass, length)
            bad = [model.arm.joint_names[i] for i in (least <= 0).nonzero()[:, 0].tolist()]
            if bad:
                raise RobotError(
                    f"the description of {model.arm.name} is not physically consistent at the links of "
                    f"{', '.join(bad)}: pull='euclid' takes it all the same"
                )
        task = Task(
            information=information,
            moment=moment,
            mapping=model.mapping,
            mass=mass,
            length=length,
            nominal=nominal,
            not_negative=[model.standard_slice(name) for name in model.kinds if name in _NOT_NEGATIVE],
            **{f.name: getattr(self, f.name) for f in fields(self) if f.name != "prior"},
        )
        standard = most_likely(task)
        links = standard[: 10 * model.joints].reshape(-1, 10)
        if not (least_eigenvalues(links, mass, length) > 0).all():
            raise InfeasibleError("the solver left a link that cannot exist; a larger margin may help")
        return standard
