"""Uncertainty of a model as a design goal: trajectories that add to what is already known."""

from dataclasses import replace

import numpy as np

from sidegan.base.arrays import Array, geometric_mean
from sidegan.design.objective import Goal
from sidegan.identification.goals import purpose_of, usual_torque
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.prior import belief
from sidegan.identification.settings import GoalSettings
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

_SAMPLES = 160  # samples of a trajectory for its information
_LEAST = 1e-9  # relative lower bound of prior variance and information: keeps factors of singular ones finite


class Uncertain:
    """The uncertainty of a model with friction and rotor inertias, as far as an objective depends on it.

    A ``design.search.SetGoal``: trajectories are designed one after another, each given those before it.

    Args:
        model: the model to identify.
        covariance: of its parameters before the set, (P, P).
        certainty: inverse standard deviation of an independent sample's torque, (J,).
        rate: rate of independent samples [Hz].
        objective: as in ``GoalSettings``.
        identified: whether the arm was already identified, from recordings without a tool.

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
        self._scale, self._before = _known(covariance)
        self._motion = np.zeros_like(self._before)
        self.purpose = purpose_of(objective, model, self._scale, identified)

    def take(self, trajectory: Trajectory, c: Array) -> None:
        """Add a trajectory with coefficients [rad/s], (J, H, 2), to the set."""
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
        """Deviations of the objective's K quantities before the set, (K,)."""
        return self.purpose.deviations(self._before, np.zeros_like(self._motion))

    @property
    def deviations(self) -> Array:
        """Deviations of the objective's K quantities after the set, (K,)."""
        return self.purpose.deviations(self._before, self._motion)

    @property
    def left(self) -> float:
        """Geometric mean of the ratios of deviations after and before the set."""
        return geometric_mean(self.deviations / self.before)


def unmeasured(body: RigidBody, terms: Terms, goal: GoalSettings) -> Uncertain:
    """Uncertainty of an arm with a description but no recordings."""
    model = TorqueModel(body, terms)
    usual = usual_torque(body)
    covariance = np.linalg.inv(belief(model, usual))
    return Uncertain(model, covariance, 1 / goal.deviation(usual), goal.rate, goal.objective)


def _known(covariance: Array) -> tuple[Array, Array]:
    """Standard deviations, (P,), and positive definite information in units of them, (P, P)."""
    variance = covariance.diagonal()
    least = np.maximum(variance, _LEAST * variance.max())
    unit = np.sqrt(least)
    scaled = (covariance + np.diag(least - variance)) / unit / unit[:, None]
    known = np.linalg.pinv(scaled, rtol=len(unit) * np.finfo(float).eps, hermitian=True)
    return unit, (known + known.T) / 2 + _LEAST * np.eye(len(unit))
