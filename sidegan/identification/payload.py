"""The load of an arm, from recordings without and with it: mass, centre of mass, inertia, with errors."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.identification.consistent import Pull, most_likely
from sidegan.identification.fit import TorqueErrors, covariance_of, inflation_of, reweighted
from sidegan.identification.gather import Gathered, gather, residual_of
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import rows_of, solve
from sidegan.motion.dynamics import LINK_PARAMETERS
from sidegan.robot.consistency import about_the_centre

LOAD = len(LINK_PARAMETERS)  # parameters of what is fixed to the last link, the last ones of the model
_LIGHTEST, _LENGTH = 0.05, 0.05  # [kg], [m] of a typical load, where the samples leave it open
_STRENGTH = 0.1  # of the pull towards a ball of that length, which chooses what the samples leave open
_CLEAR = 3.0  # deviations from which a mass is one
_STEP = 1e-30  # of a derivative
VALUES = ("mass", "cx", "cy", "cz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")  # inertia about the centre


@dataclass(frozen=True, eq=False)
class Payload:
    """A load that is rigidly fixed to an arm's last link."""

    link: str  # in whose frame its parameters are
    estimate: Array  # its parameters in Pinocchio's order, as least squares gives them, (10,)
    covariance: Array  # of their errors, (10, 10)
    body: Array  # the most probable ones of a body that can exist, (10,)
    without: Array  # nMSE of each joint on the runs with the load, where it is not accounted for, (J,)
    explained: Array  # nMSE of each joint on these runs with it, (J,)

    @property
    def values(self) -> Array:
        """Mass [kg], centre of mass [m] and inertia about it [kg·m²] of the body, as ``VALUES``, (10,)."""
        return values_of(self.body[None])[0]

    @property
    def deviation(self) -> Array:
        """Standard deviation of each of these, (10,)."""
        turned = values_of(self.body + _STEP * 1j * np.eye(LOAD))  # a complex step: no difference is taken
        slope = turned.imag.T / _STEP
        return np.sqrt(np.maximum((slope @ self.covariance @ slope.T).diagonal(), 0))

    @property
    def certain(self) -> bool:
        """Whether there is a load beyond doubt."""
        return bool(self.values[0] > _CLEAR * self.deviation[0])


def values_of(parameters: Array) -> Array:
    """Mass, centre of mass and inertia about it, in ``VALUES``' order, of link parameters, (K, 10) both."""
    centre, inertia = about_the_centre(parameters)
    rows, columns = [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]
    return np.concatenate([parameters[:, :1], centre, inertia[:, rows, columns]], 1)


def identify_payload(model: TorqueModel, unloaded: list[Measurements], loaded: list[Measurements]) -> Payload:
    """Load of the runs with one, beside those without.

    The arm's parameters are unknown too, and the same in all runs: [Y 0; Y Y_last] [θ; load] = τ.

    Source: Khalil, Gautier, Lemoine 2007, Identification of the payload inertial parameters of industrial
    manipulators, method 2.
    """
    parts = gathered(model, unloaded, loaded)
    sums = parts[0].sums.plus(parts[1].sums)
    fit = reweighted(sums)
    residuals = [residual_of(part.model, x, fit.parameters) for part in parts for x in part.pieces]
    errors = TorqueErrors(sums.squares(fit.parameters) / sums.weight, inflation_of(residuals))
    covariance = covariance_of(sums, fit, errors)[-LOAD:, -LOAD:]
    load = fit.parameters[-LOAD:]
    empty = np.concatenate([fit.parameters[:-LOAD], np.zeros(LOAD)])
    without, explained = (parts[1].sums.nmse(x) for x in (empty, fit.parameters))
    body = _possible(load, covariance)
    return Payload(model.arm.link_names[-1], load, covariance, body, without, explained)


def _possible(estimate: Array, covariance: Array) -> Array:
    """The most probable parameters (10,) of a body that can exist, from an estimate and its covariance.

    min over pseudo-inertias P of ½ |x − x̂|² in units of the errors + strength · d(P, P⁰), P⁰ a small ball.
    """
    _, information = solve(covariance, np.zeros(LOAD), 1e-12)
    rows, right = rows_of(information, information @ estimate)
    size = np.array([[_LENGTH, _LENGTH, _LENGTH, 1.0]])
    unit = max(estimate[0], _LIGHTEST) ** 0.5 * size  # in which the ball is the identity
    return most_likely(rows, right, Pull(unit, np.eye(4)[None], np.array([_STRENGTH])))


class Loaded:
    """A model of an arm with columns behind it for what is fixed to its last link, zero where nothing is."""

    kinds = ("load",)  # a model with more than rigid base parameters

    def __init__(self, model: TorqueModel, carried: bool) -> None:
        self._model = model
        self._carried = carried
        self.joints = model.joints
        self.count = model.count + LOAD

    def regressor(self, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Regressor, (S, J, P + 10), of states (S, J)."""
        load = self._model.body.regressor(q, dq, ddq)[..., -LOAD:] * self._carried
        return np.concatenate([self._model.regressor(q, dq, ddq, sign), load], 2)


def gathered(model: TorqueModel, unloaded: list[Measurements], loaded: list[Measurements]) -> list[Gathered]:
    """Sums over runs without and with the load, of one set of parameters."""
    runs = ((unloaded, False), (loaded, True))
    return [gather(Loaded(model, carried), samples) for samples, carried in runs]  # type: ignore[arg-type]
