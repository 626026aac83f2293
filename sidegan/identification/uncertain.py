"""Uncertainty of a model as a goal of design: trajectories that tell it beside what is known."""

from dataclasses import replace

import numpy as np

from sidegan.base.arrays import Array
from sidegan.design.goal import Goal
from sidegan.identification.goals import purpose_of, usual_torque
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.prior import belief
from sidegan.identification.settings import GoalSettings
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

_SAMPLES = 160  # at which the information of a trajectory is taken
_LEAST = 1e-9  # of what is known of a parameter: keeps factors of singular information finite


class Uncertain:
    """The uncertainty of a model, rotors and friction included, as far as an objective asks for it.

    A ``design.search.SetGoal``: trajectories are designed one after another, each given those before it.

    Args:
        model: that was, or is to be, identified.
        covariance: of its parameters' errors, (P, P).
        certainty: one over the deviation of an independent sample's torque, (J,).
        rate: of the samples [Hz].
        objective: of ``GoalSettings``.
        identified: whether the model was, from recordings without a tool.

    Raises:
        ConfigError: when the objective does not fit the arm.
    """

    def __init__(
        self,
        model: TorqueModel,
        covariance: Array,
        certainty: Array,
        rate: float,
        objective: str | list[str] = "parameters",
        identified: bool = False,
    ) -> None:
        self._model = model
        self._certainty = certainty
        self._rate = rate
        self._scale, self._before = _known(covariance)  # units of the parameters, information in these
        self._motion = np.zeros_like(self._before)
        self.purpose = purpose_of(objective, model, self._scale, identified)

    def take(self, trajectory: Trajectory, c: Array) -> None:
        """Count a trajectory with coefficients [rad/s], (J, H, 2), as one of the set."""
        times = trajectory.grid(_SAMPLES)
        states = [x[0] for x in trajectory.roll_out(c[None], times)[1:]]
        y = self._model.regressor(*states) * self._certainty[:, None] * self._scale
        rows = y.transpose(1, 2, 0)
        self._motion = self._motion + self._rate * trajectory.period / len(times) * (rows @ rows.mT).sum(0)

    def next(self) -> Goal:
        """The goal of the next trajectory."""
        prior = (self._before + self._motion) / self._scale / self._scale[:, None]
        goal = self.purpose.goal
        return replace(goal, prior=prior, certainty=self._certainty, rate=self._rate, model=self._model)

    @property
    def before(self) -> Array:
        """Deviation of each of what is to be known without any trajectory, (K,)."""
        return self.purpose.deviations(self._before, np.zeros_like(self._motion))

    @property
    def deviations(self) -> Array:
        """Deviation of each of what is to be known with those of the set, (K,)."""
        return self.purpose.deviations(self._before, self._motion)

    @property
    def left(self) -> float:
        """Deviations with the set over those without, their geometric mean."""
        return float(np.exp(np.log(self.deviations / self.before).mean()))


def unmeasured(body: RigidBody, terms: Terms, goal: GoalSettings) -> Uncertain:
    """Uncertainty of an arm of which there is a description and nothing else."""
    model = TorqueModel(body, terms)
    usual = usual_torque(body)
    covariance = np.linalg.inv(belief(model, usual))
    return Uncertain(model, covariance, 1 / goal.deviation(usual), goal.rate, goal.objective)


def _known(covariance: Array) -> tuple[Array, Array]:
    """Deviations, (P,), and information in units of them, positive definite, (P, P)."""
    variance = covariance.diagonal()
    least = np.maximum(variance, _LEAST * variance.max())
    unit = np.sqrt(least)
    scaled = (covariance + np.diag(least - variance)) / unit / unit[:, None]
    known = np.linalg.pinv(scaled, rtol=len(unit) * np.finfo(float).eps, hermitian=True)
    return unit, (known + known.T) / 2 + _LEAST * np.eye(len(unit))
