"""Goals of a set of trajectories: parameters, a tool, or torques, given what is already known.

Information matrices (P, P) are in units of the parameters' prior deviations: ``known`` is the information
before the set, ``motion`` that of the set, G = Σ Yᵀ Y over the noise variance.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array, geometric_mean
from sidegan.base.names import listed, plain
from sidegan.base.settings_text import suggestion
from sidegan.design.objective import Goal
from sidegan.errors import ConfigError
from sidegan.identification.model import POWERS, Terms, TorqueModel, typical
from sidegan.identification.settings import GoalSettings
from sidegan.identification.verdict import joint_of
from sidegan.motion.dynamics import LINK_PARAMETERS, RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.plant.varied import torque_scale

_TOOL_MASS, _TOOL_LEVER = 1.0, 0.1  # of a typical tool [kg], [m]
_DOUBT = 10.0  # prior deviation of a tool's parameters, in units of the typical ones
_IDENTIFIED = 0.5  # largest ratio of deviations after and before at which a parameter counts as identified
_UNITS = ("kg", "kg·m", "kg·m²")
_FLOOR = 0.02  # lower bound of a joint's usual torque, as a share of the largest joint's
_SAMPLES = 160  # samples of a trajectory for its information
_LEAST = 1e-9  # relative lower bound of prior variance and information: keeps factors of singular ones finite


class Parameters:
    """D-optimal design for all parameters, or for those of some links and their joints.

    ``prior`` has the parameters' prior deviations, (P,), here and in the classes below.
    """

    def __init__(self, model: TorqueModel, prior: Array, links: Sequence[str] | None = None) -> None:
        arm = model.arm
        places = [arm.link_names[joint_of(name)] for name in model.names]
        if links is not None and (not links or not set(links) <= set(places)):
            raise ConfigError(
                f"goal.objective names {', '.join(links) or 'no link'}, expected some of the links that "
                f"move, {', '.join(dict.fromkeys(places))}, or {suggestion('goal.objective', 'parameters')}"
            )
        selected = [links is None or place in links for place in places]
        self._links = links
        self._selected = np.array(selected)
        self.names = tuple(itertools.compress(model.names, selected))
        self._prior = prior[self._selected]
        self.goal = Goal("volume", targets=np.eye(model.count)[self._selected])

    def deviations(self, known: Array, motion: Array) -> Array:
        """Standard deviation of each parameter, (K,)."""
        variances = np.linalg.inv(known + motion).diagonal()[self._selected]
        return np.sqrt(np.maximum(variances, 0)) * self._prior

    def summary(self, deviations: Array, before: Array) -> str:
        """Sentence on how far the deviations fall."""
        share = geometric_mean(deviations / before)
        whose = "" if self._links is None else f" of {', '.join(self._links)}"
        percent = plain(100 * share, ".2g")
        return f"with the set the deviations of the parameters{whose} fall to {percent}% (geometric mean)"


class Tool:
    """Ten parameters of a tool on the last link.

    The motion is executed with the tool and, unless the arm was identified before, also without it; the
    arm's unknown parameters are the same in both. As in ``payload``: [Y 0; Y Y_last] [θ; tool] = τ.
    """

    def __init__(self, model: TorqueModel, prior: Array, identified: bool) -> None:
        last = slice(10 * (model.joints - 1), 10 * model.joints)
        self.names = tuple(f"tool {name}" for name in LINK_PARAMETERS)
        self._typical = _TOOL_MASS * _TOOL_LEVER**POWERS
        effect = model.mapping[:, last] * self._typical  # of the tool on the arm's parameters, (P, 10)
        self._effect = effect / prior[:, None]
        self._runs = 1 if identified else 2
        self._before = np.eye(10) / _DOUBT**2
        self.goal = Goal("tool", targets=effect.T, tool_prior=self._before, runs=self._runs)

    def deviations(self, known: Array, motion: Array) -> Array:
        """Standard deviation of mass [kg], mass times centre [kg·m] and inertia [kg·m²], (10,)."""
        tool = motion @ self._effect
        solved = np.linalg.solve(known + self._runs * motion, tool)
        variances = np.linalg.inv(self._effect.T @ tool - tool.T @ solved + self._before).diagonal()
        return np.sqrt(np.maximum(variances, 0)) * self._typical

    def summary(self, deviations: Array, before: Array) -> str:
        """Sentence on the errors of mass, mass times centre and inertia, as far as they are identified."""
        found = deviations < _IDENTIFIED * before
        runs = "" if self._runs == 1 else ", executed with and without it"
        if not found.any():
            return f"no parameter of a tool is identified{runs}"
        groups = zip(_UNITS, np.split(deviations, [1, 4]), np.split(found, [1, 4]))
        sizes = [f"± {np.sqrt(np.square(x[ok]).mean()):.2g} {unit}" for unit, x, ok in groups if ok.any()]
        missing = [name.removeprefix("tool ") for name in itertools.compress(self.names, ~found)]
        but = f" except for {', '.join(missing)}" if missing else ""
        return f"a tool is identified to {', '.join(sizes)}{but}{runs}"


class TorquePrediction:
    """Expected squared error of torques within the limits, relative to the joints' usual torques."""

    def __init__(self, model: TorqueModel, prior: Array, usual: Array) -> None:
        self.names = model.arm.joint_names
        y = model.regressor(*model.usual_states()) / usual[:, None]
        rows = y.transpose(1, 2, 0)
        squares = rows @ rows.mT / len(y)
        eigenvalues, vectors = np.linalg.eigh(squares.mean(0))
        kept = eigenvalues > 0
        self.goal = Goal("variance", targets=(vectors[:, kept] * np.sqrt(eigenvalues[kept])).T)
        self._squares = squares * prior * prior[:, None]

    def deviations(self, known: Array, motion: Array) -> Array:
        """Root mean square error of each joint's torque, relative to its usual torque, (J,)."""
        covariance = np.linalg.inv(known + motion)
        return np.sqrt(np.maximum((self._squares * covariance).sum((1, 2)), 0))

    def summary(self, deviations: Array, before: Array) -> str:
        """Sentence on the mean error."""
        now, then = (float(np.sqrt(np.square(x).mean())) for x in (deviations, before))
        return f"torques of other motions are uncertain by {now:.2%} of their usual size, {then:.2%} before"


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
        self.purpose: Parameters | Tool | TorquePrediction
        if objective == "payload":
            self.purpose = Tool(model, self._scale, identified)
        elif objective == "prediction":
            self.purpose = TorquePrediction(model, self._scale, usual_torque(model.body))
        else:
            self.purpose = Parameters(model, self._scale, objective if isinstance(objective, list) else None)

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
    def remaining(self) -> float:
        """Geometric mean of the ratios of deviations after and before the set."""
        return geometric_mean(self.deviations / self.before)


def uncertainty_of_description(body: RigidBody, terms: Terms, goal: GoalSettings) -> Uncertain:
    """Uncertainty of an arm with a description but no recordings."""
    model = TorqueModel(body, terms)
    usual = usual_torque(body)
    covariance = np.linalg.inv(belief(model, usual))
    return Uncertain(model, covariance, 1 / goal.deviation(usual), goal.rate, goal.objective)


def usual_torque(body: RigidBody) -> Array:
    """Root mean square torque of each joint within the limits [N·m or N], (J,)."""
    if not body.arm.inertial_parameters.any():
        why = f" ({listed(body.arm.massless, 1)})" if body.arm.massless else ""
        raise ConfigError(
            f"no moving link of {body.arm.name} has a mass{why}, so its usual torques are unknown: "
            f"use {suggestion('goal.objective', 'condition')}, or the URDF that an identification writes"
        )
    return torque_scale(body, _FLOOR)


def belief(model: TorqueModel, usual: Array) -> Array:
    """Prior information (P, P) from a description alone.

    Its base parameters are right to within the links' typical sizes, and a term to within its joint's usual
    torque, (J,). Grouped rotor inertias have no prior.
    """
    rows = model.body.base.mapping * typical(model.arm).ravel()
    terms = usual[model.extras % model.joints] ** -2.0
    return scipy.linalg.block_diag(np.linalg.inv(rows @ rows.T), np.diag(terms))


def _known(covariance: Array) -> tuple[Array, Array]:
    """Standard deviations, (P,), and positive definite information in units of them, (P, P)."""
    variance = covariance.diagonal()
    least = np.maximum(variance, _LEAST * variance.max())
    unit = np.sqrt(least)
    scaled = (covariance + np.diag(least - variance)) / unit / unit[:, None]
    known = np.linalg.pinv(scaled, rtol=len(unit) * np.finfo(float).eps, hermitian=True)
    return unit, (known + known.T) / 2 + _LEAST * np.eye(len(unit))
