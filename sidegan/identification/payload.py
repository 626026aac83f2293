"""Mass, centre of mass and inertia of a load, with errors, from recordings without and with it."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.identification.consistent import Pull, most_likely
from sidegan.identification.fit import TorqueErrors, covariance_of, inflation_of, reweighted
from sidegan.identification.gather import Gathered, gather, residual_of
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import rows_of, solve
from sidegan.motion.dynamics import LINK_PARAMETERS
from sidegan.robot.consistency import about_the_centre

LOAD = len(LINK_PARAMETERS)  # parameters of a load on the last link; they come last in ``Loaded``
_LIGHTEST, _LENGTH = 0.05, 0.05  # least mass [kg] and length [m] of the nominal load
_STRENGTH = 0.1  # of the pull towards a ball of that size, which decides what the samples leave open
_CLEAR = 3.0  # standard deviations at which a mass is significant
_STEP = 1e-30  # of a complex-step derivative
VALUES = ("mass", "cx", "cy", "cz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")  # inertia about the centre


@dataclass(frozen=True, eq=False)
class Payload:
    """A load that is rigidly fixed to an arm's last link."""

    link: str  # link whose frame the parameters are in
    estimate: Array  # least-squares parameters in Pinocchio's order, (10,)
    covariance: Array  # of the estimate, (10, 10)
    body: Array  # most probable physically consistent parameters, (10,)
    without: Array  # nMSE of each joint on the loaded runs without the load in the model, (J,)
    explained: Array  # the same with the load in the model, (J,)

    @property
    def values(self) -> Array:
        """Mass [kg], centre of mass [m] and inertia about it [kg·m²] of the body, as ``VALUES``, (10,)."""
        return values_of(self.body[None])[0]

    @property
    def deviation(self) -> Array:
        """Standard deviation of each of these, (10,)."""
        jacobian = values_of(self.body + _STEP * 1j * np.eye(LOAD)).imag.T / _STEP  # by complex step
        return np.sqrt(np.maximum((jacobian @ self.covariance @ jacobian.T).diagonal(), 0))

    @property
    def certain(self) -> bool:
        """Whether the load's mass is significant."""
        return bool(self.values[0] > _CLEAR * self.deviation[0])


def values_of(parameters: Array) -> Array:
    """Mass, centre of mass and inertia about it, as ``VALUES``, from link parameters, (K, 10) both."""
    centre, inertia = about_the_centre(parameters)
    rows, columns = [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]
    return np.concatenate([parameters[:, :1], centre, inertia[:, rows, columns]], 1)


def identify_payload(model: TorqueModel, unloaded: list[Measurements], loaded: list[Measurements]) -> Payload:
    """Identify a load from runs without and with it.

    The arm's parameters are also unknown, and the same in all runs: [Y 0; Y Y_last] [θ; load] = τ. Offsets of
    torques may differ between them, as after taring.

    Source: Khalil, Gautier, Lemoine 2007, Identification of the payload inertial parameters of industrial
    manipulators, method 2.

    Raises:
        RecordingError: when the load is clearly negative.
    """
    parts = gathered(model, unloaded, loaded, tared=True)
    sums = parts[0].sums.plus(parts[1].sums)
    fit = reweighted(sums)
    residuals = [residual_of(part.model, x, fit.parameters) for part in parts for x in part.pieces]
    errors = TorqueErrors(sums.squares(fit.parameters) / sums.weight, inflation_of(residuals))
    covariance = covariance_of(sums, fit, errors)[-LOAD:, -LOAD:]
    load = fit.parameters[-LOAD:]
    sigma = float(np.sqrt(covariance[0, 0]))
    if load[0] < -_CLEAR * sigma:
        raise RecordingError(
            f"the load would be {load[0]:.4g} ± {sigma:.1g} kg: are recordings and loaded exchanged?"
        )
    body = _possible(load, covariance)
    whole = [np.concatenate([fit.parameters[:-LOAD], x]) for x in (np.zeros(LOAD), body)]
    without, explained = map(parts[1].sums.nmse, whole)
    return Payload(model.arm.link_names[-1], load, covariance, body, without, explained)


def _possible(estimate: Array, covariance: Array) -> Array:
    """The most probable physically consistent parameters, (10,), from an estimate and its covariance.

    min over pseudo-inertias P of ½ |x − x̂|² in units of the errors + strength · d(P, P⁰), P⁰ a small ball.
    """
    _, information = solve(covariance, np.zeros(LOAD), 1e-12)
    rows, right = rows_of(information, information @ estimate)
    size = np.array([[_LENGTH, _LENGTH, _LENGTH, 1.0]])
    unit = max(estimate[0], _LIGHTEST) ** 0.5 * size  # makes the ball's pseudo-inertia the identity
    return most_likely(rows, right, Pull(unit, np.eye(4)[None], np.array([_STRENGTH])))


class Loaded:
    """An arm's model with additional columns for a load on its last link, zero when it is not carried.

    ``tared`` sensors have further offsets, (J,), in the runs with the load; their columns precede the load's.
    """

    def __init__(self, model: TorqueModel, carried: bool, tared: bool = False) -> None:
        self._model = model
        self._carried = carried
        self.joints = model.joints
        self._further = np.eye(self.joints) if tared and model.terms.offset else np.empty((self.joints, 0))
        self.count = model.count + self._further.shape[1] + LOAD

    def regressor(self, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Regressor, (S, J, P + O + 10), of states (S, J), with O further offsets."""
        load = self._model.body.regressor(q, dq, ddq)[..., -LOAD:]
        further = np.broadcast_to(self._further, (len(q), *self._further.shape))
        added = self._carried * np.concatenate([further, load], 2)
        return np.concatenate([self._model.regressor(q, dq, ddq, sign), added], 2)


def gathered(
    model: TorqueModel, unloaded: list[Measurements], loaded: list[Measurements], tared: bool = False
) -> list[Gathered[Loaded]]:
    """Sums over the runs without the load, then over those with it, for the same parameters."""
    runs = ((unloaded, False), (loaded, True))
    return [gather(Loaded(model, x, tared), samples) for samples, x in runs]
