"""Drive gains, from motor current to joint torque, from runs without and with a known load."""

from dataclasses import dataclass
from itertools import chain

import torch
from torch import Tensor

from sidegan.errors import ConfigError, RecordingError, ShapeError
from sidegan.identification.accuracy import inflation_of
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.payload import LOAD, gathered
from sidegan.identification.sums import Sums, solve
from sidegan.robot import Arm

_LEAST = 1e-6  # information on each parameter beside the samples'
_REPETITIONS = 200
_SETTLED = 1e-9
_HALVINGS = 20
_ROUNDING = 1e-13  # of the squares of currents: sums resolve no less
_SILENT = 1e-9  # of the largest effect of the load on a joint
_SEEN = 30.0  # deviations of the load's part of the currents; one that is not there passes for up to twenty
_SURE = 5.0  # deviations from nothing, from which a load is seen: the gain is known to a fifth


@dataclass(frozen=True, eq=False)
class Gains:
    """Drive gains of an arm."""

    gains: Tensor  # torque per current [N·m/A or N/A], (J,)
    deviation: Tensor  # standard deviation of each, (J,)
    parameters: Tensor  # of the arm's model without the load, found together with them, (P,)

    @property
    def certain(self) -> Tensor:
        """Whether a joint's gain may be used: the load is seen, and pulls as it should, (J,)."""
        return self.gains > _SURE * self.deviation

    def doubts(self, arm: Arm) -> list[str]:
        """Why some gains may not be used, a sentence each, with the joints by name."""
        against, doubts = self.gains < -_SURE * self.deviation, []
        if unseen := arm.named(~self.certain & ~against):
            doubts.append(
                f"the load is not seen in the current of {unseen}: the gain has a σ of more than "
                f"{1 / _SURE:.0%} of it; a heavier load tells it, or one further from the flange"
            )
        if reversed_ := arm.named(against):
            doubts.append(
                f"the gain of {reversed_} is below zero: is its current counted the other way round? "
                f"(recording.reverse=[{reversed_.replace(', ', ',')}])"
            )
        return doubts


def drive_gains(
    model: TorqueModel, unloaded: list[Measurements], loaded: list[Measurements], load: Tensor
) -> Gains:
    """Torque per current of each joint, from currents recorded without and with a known load.

    Without a known load, currents give the arm's parameters up to a factor per joint; the load sets it. The
    model is i_j = (Y_j θ + y_load,j) / k_j with errors in the currents. Given the gains it is linear in θ,
    and given θ in 1 / k_j; both are found together by Gauss-Newton on the sums over the samples.

    Args:
        model: of the arm without the load.
        unloaded: measurements whose torque holds currents [A].
        loaded: the same with the load.
        load: its ten parameters in Pinocchio's order about the last joint's frame.

    Raises:
        ShapeError: when the load is not ten finite numbers, or measurements do not fit the model.
        ConfigError: when the load has no effect on a joint, whose gain stays unknown.
        RecordingError: when the load is not seen in the currents.

    Source: Gautier, Briot 2014, Global identification of joint drive gains and dynamic parameters of robots.
    """
    if load.shape != (LOAD,) or not load.isfinite().all():
        raise ShapeError(f"the load is {tuple(load.shape)}, expected ten finite parameters")
    parts = gathered(model, unloaded, loaded, load.double())
    sums, effect = parts[0].sums.plus(parts[1].sums), parts[1].sums.information[:, -1, -1]
    if silent := model.arm.named(effect <= _SILENT * effect.max()):
        raise ConfigError(f"the load has no effect on {silent}: what its drive gives cannot be told")
    system = _solved(sums)
    whole = torch.cat([system.parameters, torch.ones(1, dtype=torch.float64)])
    residuals = chain.from_iterable(
        (x.torque - system.inverse_gains * (part.model.regressor(*x.inputs) @ whole) for x in part.kept)
        for part in parts
    )
    inflation = inflation_of(residuals)
    _refuse_unseen(system.weights * system.inverse_gains.square() * effect / inflation)
    _, inverse = solve(system.normal, system.gradient, _LEAST)
    gains = 1 / system.inverse_gains
    variance = inverse.diagonal()[-model.joints :] * inflation.amax()
    return Gains(gains, variance.sqrt() * gains.square(), system.parameters)


def _refuse_unseen(squares: Tensor) -> None:
    """Refuse currents in which the load's part, (J,) in squared deviations, is no more than noise.

    Raises:
        RecordingError: saying how much it is; the gains' own deviations mean nothing then.
    """
    strength = float(squares.sum().sqrt())
    if strength < _SEEN:
        raise RecordingError(
            f"the load is not seen in the currents: its part of them is {strength:.2g} deviations, expected "
            f"{_SEEN:g} or more; was it on the arm in loaded, and is it heavy enough?"
        )


def _solved(sums: Sums) -> "_System":
    """The equations at the gains and parameters that solve them; no step leads uphill."""
    system, joints = _System(sums, *_start(sums)), len(sums.energy)
    for _ in range(_REPETITIONS):
        step, _ = solve(system.normal, system.gradient, _LEAST)
        now = system.cost(0 * step)
        for _ in range(_HALVINGS):
            if system.cost(step) <= now * (1 + _SETTLED):
                break
            step = step / 2
        system = _System(sums, *system.after(step))
        if (step[-joints:] / system.inverse_gains).abs().max() < _SETTLED:
            break
    return system


def _start(sums: Sums) -> tuple[Tensor, Tensor]:
    """Inverse gains and parameters from k_j i_j − Y_j θ = y_load: linear, but biased by noisy currents."""
    count = sums.moment.shape[1] - 1
    own, load = sums.information[:, :-1, :-1].sum(0), sums.information[:, :-1, -1].sum(0)
    side = -sums.moment[:, :-1]
    normal = torch.cat([torch.cat([own, side.T], 1), torch.cat([side, torch.diag(sums.energy)], 1)])
    found, _ = solve(normal, torch.cat([-load, sums.moment[:, -1]]), _LEAST)
    return 1 / found[count:], found[:count]


class _System:
    """Gauss-Newton's equations at some inverse gains (J,) and parameters (P,), from sums of [Y, y_load].

    Steps are of the parameters, then of the inverse gains, (P + J,).
    """

    def __init__(self, sums: Sums, inverse_gains: Tensor, parameters: Tensor) -> None:
        self._sums, self.inverse_gains, self.parameters = sums, inverse_gains, parameters
        whole = torch.cat([parameters, torch.ones(1, dtype=torch.float64)])
        reach = sums.information @ whole
        power, match = reach @ whole, (sums.moment * whole).sum(1)
        self.weights = sums.weight / self._squares(inverse_gains, parameters)
        w, k = self.weights, inverse_gains
        top = torch.einsum("j,jpq->pq", w * k.square(), sums.information[:, :-1, :-1])
        side = (w * k)[:, None] * reach[:, :-1]
        self.normal = torch.cat([torch.cat([top, side.T], 1), torch.cat([side, torch.diag(w * power)], 1)])
        pull = torch.einsum("j,jp->p", w * k, sums.moment[:, :-1] - k[:, None] * reach[:, :-1])
        self.gradient = torch.cat([pull, w * (match - k * power)])

    def after(self, step: Tensor) -> tuple[Tensor, Tensor]:
        """Inverse gains and parameters after a step."""
        count = len(self.parameters)
        return self.inverse_gains + step[count:], self.parameters + step[:count]

    def cost(self, step: Tensor) -> float:
        """Weighted squares of the currents' residuals after a step, with the weights of before."""
        return float(self.weights @ self._squares(*self.after(step)))

    def _squares(self, k: Tensor, x: Tensor) -> Tensor:
        sums, whole = self._sums, torch.cat([x, torch.ones(1, dtype=torch.float64)])
        found = sums.energy - 2 * k * (sums.moment @ whole) + k.square() * (sums.information @ whole @ whole)
        return torch.maximum(found, _ROUNDING * sums.energy)
