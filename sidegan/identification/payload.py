"""A load on the last link, from runs without and with it; or the drives' gains, if the load is known."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError, RecordingError
from sidegan.identification.consistent import Pull, most_likely
from sidegan.identification.fit import (
    LEAST,
    Extended,
    Gathered,
    TorqueErrors,
    covariance_of,
    gather,
    inflation_of,
    residual_of,
    weighted_least_squares,
)
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import rows_of, solve
from sidegan.identification.thresholds import CERTAIN, LOAD_SHOWN, LOADED
from sidegan.motion.dynamics import LINK_PARAMETERS
from sidegan.recording.agreement import to_reverse
from sidegan.robot import Arm
from sidegan.robot.consistency import about_the_centre

LOAD = len(LINK_PARAMETERS)  # parameters of a load on the last link; they come last in ``with_load``
_LIGHTEST, _LENGTH = 0.05, 0.05  # least mass [kg] and length [m] of the nominal load
_STRENGTH = 0.1  # of the pull towards a ball of that size, which decides what the samples leave open
_SILENT = 1e-9  # relative to the joint with the largest effect: below it, the load has none
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
        return bool(self.values[0] > LOADED * self.deviation[0])


def values_of(parameters: Array) -> Array:
    """Mass, centre of mass and inertia about it, as ``VALUES``, from link parameters, (K, 10) both."""
    centre, inertia = about_the_centre(parameters)
    rows, columns = [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]
    return np.concatenate([parameters[:, :1], centre, inertia[:, rows, columns]], 1)


def identify_payload(model: TorqueModel, unloaded: list[Measurements], loaded: list[Measurements]) -> Payload:
    """Identify a load from runs without and with it.

    The arm's parameters are also unknown, and the same in all runs: [Y 0; Y Y_last] [θ; load] = τ. Offsets of
    torques may differ between them, as after taring. The body is the most probable physically consistent one:
    min over pseudo-inertias P of ½ |x − x̂|² in units of the errors + strength · d(P, P⁰), P⁰ a small ball.

    Source: Khalil, Gautier, Lemoine 2007, Identification of the payload inertial parameters of industrial
    manipulators, method 2.

    Raises:
        RecordingError: when the load is clearly negative.
    """
    parts = _gathered(model, unloaded, loaded, tared=True)
    carrying = parts[1][1].sums
    sums = parts[0][1].sums.plus(carrying)
    fit = weighted_least_squares(sums)
    residuals = [residual_of(extended, x, fit.parameters) for extended, data in parts for x in data.pieces]
    errors = TorqueErrors(sums.squares(fit.parameters) / sums.weight, inflation_of(residuals))
    covariance = covariance_of(sums, fit, errors)[-LOAD:, -LOAD:]
    load = fit.parameters[-LOAD:]
    sigma = float(np.sqrt(covariance[0, 0]))
    if load[0] < -LOADED * sigma:
        raise RecordingError(
            f"the load would be {load[0]:.4g} ± {sigma:.1g} kg: are recordings and loaded exchanged?"
        )
    _, information = solve(covariance, np.zeros(LOAD), 1e-12)
    rows, right = rows_of(information, information @ load)
    # makes the ball's pseudo-inertia the identity
    unit = max(load[0], _LIGHTEST) ** 0.5 * np.array([[_LENGTH, _LENGTH, _LENGTH, 1.0]])
    body = most_likely(rows, right, Pull(unit, np.eye(4)[None], np.array([_STRENGTH])))
    whole = [np.concatenate([fit.parameters[:-LOAD], x]) for x in (np.zeros(LOAD), body)]
    return Payload(model.arm.link_names[-1], load, covariance, body, *map(carrying.nmse, whole))


def with_load(model: TorqueModel, carried: bool, tared: bool = False) -> Extended:
    """The model with columns for a load on its last link, zero when it is not carried.

    ``tared`` sensors have further offsets, (J,), in the runs with the load; their columns precede the load's.
    """
    offsets = np.eye(model.joints) if tared and model.terms.offset else np.empty((model.joints, 0))

    def columns(q: Array, dq: Array, ddq: Array, _: Array | None) -> Array:
        load = model.body.regressor(q, dq, ddq)[..., -LOAD:]
        return carried * np.concatenate([np.broadcast_to(offsets, (len(q), *offsets.shape)), load], 2)

    return Extended(model, offsets.shape[1] + LOAD, columns)


def _gathered(
    model: TorqueModel, unloaded: list[Measurements], loaded: list[Measurements], tared: bool
) -> list[tuple[Extended, Gathered]]:
    """Model and sums of the runs without the load, then of those with it, for the same parameters."""
    models = [with_load(model, carried, tared) for carried in (False, True)]
    return [(extended, gather(extended, runs)) for extended, runs in zip(models, (unloaded, loaded))]


@dataclass(frozen=True, eq=False)
class Gains:
    """Drive gains of an arm."""

    gains: Array  # torque per current [N·m/A or N/A], (J,)
    deviation: Array  # standard deviation of each, (J,)
    against: Array  # whether currents run against the description, whatever the load, (J,) bool

    @property
    def certain(self) -> Array:
        """Whether a joint's gain may be used: the load's effect is clear and has the right sign, (J,)."""
        return self._clear & (self.gains > 0) & ~self.against & (not self.exchanged)

    @property
    def exchanged(self) -> bool:
        """Whether most currents look as if the load was carried in the runs without it, not in the others."""
        return bool(2 * self._taken_off.sum() > self._clear.sum())

    @property
    def _clear(self) -> Array:
        """Whether the load's effect is clear, (J,)."""
        return np.abs(self.gains) > CERTAIN * self.deviation

    @property
    def _taken_off(self) -> Array:
        """Whether a current shows the load clearly, with the other sign than the arm itself, (J,)."""
        return self._clear & ((self.gains < 0) != self.against)

    def doubts(self, arm: Arm, reverse: Sequence[str] = ()) -> list[str]:
        """Reasons why some gains may not be used, with the joints' names; ``reverse`` is that setting."""
        negative = self._clear & (self.gains < 0)
        positive = self._clear & ~negative
        if self.exchanged:
            also = f" If so, signs of currents are reversed, too {to_reverse(arm, positive, reverse)}"
            return [
                f"the currents of {arm.named(self._taken_off)} change as if the load were taken off: are "
                f"recordings and loaded exchanged?{also if positive.any() else ''}"
            ]
        doubts = []
        if unseen := arm.named(~self._clear):
            doubts.append(
                f"the current of {unseen} hardly shows the load: σ of the gain is more than "
                f"{1 / CERTAIN:.0%} of it; use a heavier load, or one further from the flange"
            )
        if negative.any():
            doubts.append(
                f"the gain of {arm.named(negative)} is negative: is the sign of its current reversed? "
                f"{to_reverse(arm, negative, reverse)}"
            )
        if odd := arm.named(positive & self.against):
            doubts.append(
                f"the current of {odd} shows the load with the right sign but runs against the description: "
                "is load.centre right?"
            )
        return doubts


def drive_gains(
    model: TorqueModel,
    unloaded: list[Measurements],
    loaded: list[Measurements],
    load: Array,
    against: Array | None = None,
) -> Gains:
    """Torque per current of each joint, from measurements whose ``torque`` is current [A].

    Currents alone give the arm's parameters up to a factor per joint; the known load (ten parameters in the
    last joint's frame) fixes it. Each joint is fitted separately: its current i = Y φ + g y_load is linear
    in the arm's parameters over its gain, φ, and in the inverse gain, g. If currents run ``against`` the
    description, (J,), in runs without as well as with the load, their signs are reversed, or it is wrong.

    Raises:
        ShapeError: when measurements do not fit the model.
        ConfigError: when the load has no effect on a joint, whose gain stays unknown.
        RecordingError: when the load is not seen in the currents.

    Source: after Gautier, Briot 2014, Global identification of joint drive gains and dynamic parameters of
    robots.
    """
    parts = _gathered(model, unloaded, loaded, tared=False)
    effect = parts[1][1].sums.information[:, -LOAD:, -LOAD:] @ load @ load
    if silent := model.arm.named(effect <= _SILENT * effect.max()):
        raise ConfigError(f"the load has no effect on {silent}: the gain of its drive cannot be determined")
    whole = scipy.linalg.block_diag(np.eye(model.count), load[:, None])
    sums = parts[0][1].sums.plus(parts[1][1].sums)
    each = [solve(whole.T @ a @ whole, b @ whole, LEAST) for a, b in zip(sums.information, sums.moment)]
    parameters = np.stack([whole @ found for found, _ in each])  # of each joint, (J, P + 10)
    residuals = [
        x.torque - np.einsum("sjp,jp->sj", extended.regressor(*x.inputs), parameters)
        for extended, data in parts
        for x in data.pieces
    ]
    squares = np.maximum(sums.energy - (sums.moment * parameters).sum(1), 0)  # what the best fit leaves
    spread = np.stack([covariance[-1, -1] for _, covariance in each])
    inverse = np.stack([found[-1] for found, _ in each])
    deviation = np.sqrt(squares / sums.weight * inflation_of(residuals) * spread)
    if (strength := np.linalg.norm(inverse / deviation)) < LOAD_SHOWN:
        raise RecordingError(
            f"the currents do not show the load: its effect is {strength:.2g} standard deviations, expected "
            f"{LOAD_SHOWN:g} or more; was it on the arm in loaded, and is it heavy enough?"
        )
    opposite = np.zeros(model.arm.joints, bool) if against is None else against
    return Gains(1 / inverse, deviation / np.square(inverse), opposite)
