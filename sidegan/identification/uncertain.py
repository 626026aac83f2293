"""What is uncertain of a model, as an aim of design: trajectories that tell it beside what is known."""

from functools import partial

import torch
from torch import Tensor

from sidegan.design.linear import weighted_products
from sidegan.designer.aim import Aim, noise_at
from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.goals import Everything, OfLinks, Tool, Torques, Wanted
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.prior import belief
from sidegan.identification.settings import GoalSettings
from sidegan.motion.dynamics import RigidBody
from sidegan.plant.varied import torque_scale

_FLOOR = 0.02  # of the largest joint's usual torque, that a small joint's counts as at least
_LEAST = 1e-9  # of what is known of a parameter: keeps factors of singular information finite


class Uncertain:
    """The uncertainty of what is wanted of a model, rotors and friction included.

    A ``design.sequence.SetAim``: trajectories are designed one after another, each given those before it.

    Args:
        model: that was, or is to be, identified.
        covariance: of its parameters' errors, (P, P).
        certainty: one over the deviation that a sample's torque error would have if samples were
            independent, (J,).
        rate: of the samples [Hz].
        wanted: what of it is wanted.

    Raises:
        ShapeError: when something does not fit the model.
    """

    def __init__(
        self,
        model: TorqueModel,
        covariance: Tensor,
        certainty: Tensor,
        rate: float,
        wanted: Wanted = Everything,
    ) -> None:
        if covariance.shape != (model.count, model.count) or certainty.shape != (model.joints,):
            raise ShapeError(
                f"covariance {tuple(covariance.shape)} and certainty {tuple(certainty.shape)} are not of a "
                f"model with {model.count} parameters and {model.joints} joints"
            )
        self._model, self._certainty, self._rate = model, certainty, rate
        self._scale, self._before = _known(covariance)  # units of the parameters, information in these
        self._motion = torch.zeros_like(self._before)
        self.goal = wanted(model, self._scale)

    def information(self, q: Tensor, dq: Tensor, ddq: Tensor, seconds: float) -> Tensor:
        """Information of B trajectories of so many seconds, each alone, at states (B, T, J): (B, P, P)."""
        products = weighted_products(self._model, (q, dq, ddq), self._certainty, self._scale)
        return self._rate * seconds / q.shape[1] * products

    def value(self, information: Tensor) -> Tensor:
        """The goal after each of B trajectories beside what is known, (B,)."""
        return self.goal.value(self._before, self._motion + information)

    def take(self, information: Tensor) -> None:
        """Count a trajectory of this information, (P, P), as known."""
        self._motion = self._motion + information.detach()

    def asked(self, rate: float) -> Aim:
        """The same of a designer that takes torques at a rate [Hz].

        Raises:
            TypeError: when no designer knows the goal, which has no form then.
        """
        if self.goal.form is None:
            raise TypeError("no designer knows this goal")
        kind, interest, tasks = self.goal.form
        information = (self._before + self._motion) / self._scale / self._scale[:, None]
        noise = noise_at(rate, self._rate * self._certainty.square())
        wanted = None if tasks is None else tasks.numpy()
        return Aim(kind, information.numpy(), noise, interest, self._model, wanted)

    @property
    def before(self) -> Tensor:
        """Deviation of each of what is wanted without any trajectory, (K,)."""
        return self.goal.deviations(self._before, torch.zeros_like(self._motion))

    @property
    def deviations(self) -> Tensor:
        """Deviation of each of what is wanted with those that count as known, (K,)."""
        return self.goal.deviations(self._before, self._motion)

    @property
    def left(self) -> float:
        """Deviations of what is wanted over those without any trajectory, mean along the principal axes."""
        values = (self.goal.value(self._before, x) for x in (self._motion, torch.zeros_like(self._motion)))
        return float(((next(values) - next(values)) / 2).exp())


def unmeasured(body: RigidBody, terms: Terms, goal: GoalSettings) -> Uncertain:
    """What is uncertain of an arm of which there is a description and nothing else.

    Raises:
        ConfigError: when a setting does not fit the arm.
    """
    if terms.stribeck:
        raise ConfigError(
            "velocities of model.stribeck are found from recordings: design with model.stribeck=false, or "
            "with known=… for what an identification left uncertain"
        )
    model, usual = TorqueModel(body, terms), usual_torque(body)
    covariance = torch.linalg.inv(belief(model, usual, goal.believed))
    wanted = wanted_of(goal, usual, identified=False)
    return Uncertain(model, covariance, 1 / goal.deviation(usual), goal.rate, wanted)


def _known(covariance: Tensor) -> tuple[Tensor, Tensor]:
    """Deviations, (P,), and information in units of them, positive definite, (P, P)."""
    variance = covariance.diagonal()
    least = variance.clamp_min(_LEAST * float(variance.max()))
    unit = least.sqrt()
    known = torch.linalg.pinv(
        (covariance + torch.diag(least - variance)) / unit / unit[:, None], hermitian=True
    )
    return unit, (known + known.T) / 2 + _LEAST * torch.eye(len(unit), dtype=torch.float64)


def wanted_of(goal: GoalSettings, usual: Tensor, identified: bool) -> Wanted:
    """What the settings say is wanted of an arm with these usual torques (J,) [N·m or N].

    Where nothing is said, everything: each of a small condition number is no goal for a set.
    """
    if isinstance(goal.wanted, list):
        return partial(OfLinks, links=goal.wanted)
    if goal.wanted == "payload":
        return partial(Tool, identified=identified)
    if goal.wanted == "prediction":
        return partial(Torques, usual=usual)
    return Everything


def usual_torque(body: RigidBody) -> Tensor:
    """Root mean square torque of each joint within the limits [N·m or N], (J,).

    Raises:
        ConfigError: when no link has a mass.
    """
    if not body.arm.inertial_parameters.any():
        raise ConfigError(
            f"no link of {body.arm.name} has a mass, so that its usual torques are not known: "
            "goal.wanted=condition needs none, and the URDF that +experiment=identify leaves has masses"
        )
    return torch.from_numpy(torque_scale(body, _FLOOR))
