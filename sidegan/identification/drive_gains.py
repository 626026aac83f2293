"""Drive gains (joint torque per motor current) from runs without and with a known load."""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError, RecordingError
from sidegan.identification.fit import LEAST, inflation_of
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.payload import LOAD, gathered
from sidegan.identification.sums import solve
from sidegan.recording.agreement import to_reverse
from sidegan.robot import Arm

_SILENT = 1e-9  # relative to the joint with the largest effect: below it, the load has none
_SEEN = 30.0  # standard deviations of its effect on all currents, below which the load may be absent
_SURE = 5.0  # standard deviations at which a gain is certain: it is then known to 20 %


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
        return np.abs(self.gains) > _SURE * self.deviation

    @property
    def _taken_off(self) -> Array:
        """Whether a current shows the load clearly, with the other sign than the arm itself, (J,)."""
        return self._clear & ((self.gains < 0) != self.against)

    def doubts(self, arm: Arm) -> list[str]:
        """Reasons why some gains may not be used, with the joints' names."""
        negative = self._clear & (self.gains < 0)
        positive = self._clear & ~negative
        if self.exchanged:
            also = f" If so, signs of currents are reversed, too {to_reverse(arm.named(positive))}"
            return [
                f"the currents of {arm.named(self._taken_off)} change as if the load were taken off: are "
                f"recordings and loaded exchanged?{also if positive.any() else ''}"
            ]
        doubts = []
        if unseen := arm.named(~self._clear):
            doubts.append(
                f"the current of {unseen} hardly shows the load: σ of the gain is more than "
                f"{1 / _SURE:.0%} of it; use a heavier load, or one further from the flange"
            )
        if negative.any():
            doubts.append(
                f"the gain of {arm.named(negative)} is negative: is the sign of its current reversed? "
                f"{to_reverse(arm.named(negative))}"
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
    parts = gathered(model, unloaded, loaded)
    effect = parts[1].sums.information[:, -LOAD:, -LOAD:] @ load @ load
    if silent := model.arm.named(effect <= _SILENT * effect.max()):
        raise ConfigError(f"the load has no effect on {silent}: the gain of its drive cannot be determined")
    whole = scipy.linalg.block_diag(np.eye(model.count), load[:, None])
    sums = parts[0].sums.plus(parts[1].sums)
    each = [solve(whole.T @ a @ whole, b @ whole, LEAST) for a, b in zip(sums.information, sums.moment)]
    parameters = np.stack([whole @ found for found, _ in each])  # of each joint, (J, P + 10)
    residuals = [
        x.torque - np.einsum("sjp,jp->sj", part.model.regressor(*x.inputs), parameters)
        for part in parts
        for x in part.pieces
    ]
    squares = np.maximum(sums.energy - (sums.moment * parameters).sum(1), 0)  # what the best fit leaves
    spread = np.stack([covariance[-1, -1] for _, covariance in each])
    inverse = np.stack([found[-1] for found, _ in each])
    deviation = np.sqrt(squares / sums.weight * inflation_of(residuals) * spread)
    if (strength := np.linalg.norm(inverse / deviation)) < _SEEN:
        raise RecordingError(
            f"the currents do not show the load: its effect is {strength:.2g} standard deviations, expected "
            f"{_SEEN:g} or more; was it on the arm in loaded, and is it heavy enough?"
        )
    opposite = np.zeros(model.arm.joints, bool) if against is None else against
    return Gains(1 / inverse, deviation / np.square(inverse), opposite)
