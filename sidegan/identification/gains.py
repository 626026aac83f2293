"""Drive gains, from motor current to joint torque, from runs with and without a known load."""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.gather import gather
from sidegan.identification.measurements import SAMPLES_AT_ONCE, Samples
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums, solve

_LEAST = 1e-6  # information on each parameter beside the samples'
_REPETITIONS = 200
_SETTLED = 1e-9
_HALVINGS = 20
_ROUNDING = 1e-13  # of the squares of currents: sums resolve no less


@dataclass(frozen=True, eq=False)
class Gains:
    """Drive gains of an arm.

    Attributes:
        gains: torque per current [N·m/A or N/A], (J,).
        deviation: standard deviation of each, (J,), for independent errors of the currents.
        parameters: of the arm's model without the load, found together with them, (P,).
    """

    gains: Tensor
    deviation: Tensor
    parameters: Tensor


class _Loaded:
    """The arm's model with one more column: the torque of the known load, where it is carried."""

    def __init__(self, model: TorqueModel, payload: Tensor, carried: bool) -> None:
        self._model, self._payload, self._carried = model, payload, carried
        self.joints, self.count = model.joints, model.count + 1
        self.names = [*model.names, "load"]

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor, sign: Tensor | None = None) -> Tensor:
        load = self._model.body.regressor(q, dq, ddq)[..., -10:] @ self._payload
        last = load if self._carried else torch.zeros_like(load)
        return torch.cat([self._model.regressor(q, dq, ddq, sign), last[..., None]], 2)


def drive_gains(
    model: TorqueModel,
    unloaded: Samples,
    loaded: Samples,
    payload: Tensor,
    samples_at_once: int = SAMPLES_AT_ONCE,
) -> Gains:
    """Torque per current of each joint, from currents recorded without and with a known load.

    Without a known load, currents tell the arm's parameters up to a factor per joint; the load sets it. The
    model is i_j = (Y_j θ + y_load,j) / k_j with errors in the currents. Given the gains it is linear in θ,
    and given θ in 1 / k_j; both are found together by Gauss-Newton on the sums over the samples.

    Args:
        model: of the arm without the load.
        unloaded: measurements whose torque holds currents [A].
        loaded: the same with the load.
        payload: the load's ten parameters in Pinocchio's order about the last joint's frame.
        samples_at_once: largest number of samples whose regressor is held.

    Raises:
        ShapeError: when the payload is not ten finite numbers; otherwise as ``estimate``.
        ConfigError: when the load has no effect on a joint, whose gain stays unknown.

    Source: Gautier, Briot 2014, Global identification of joint drive gains and dynamic parameters of robots.
    """
    payload = payload.double()
    if payload.shape != (10,) or not payload.isfinite().all():
        raise ShapeError(f"payload is {tuple(payload.shape)}, expected ten finite parameters")
    parts = [
        gather(_Loaded(model, payload, carried), runs, samples_at_once).sums
        for runs, carried in ((unloaded, False), (loaded, True))
    ]
    sums = parts[0].plus(parts[1])
    effect = parts[1].information[:, -1, -1]
    silent = [model.arm.joint_names[j] for j in (effect <= 1e-9 * effect.max()).nonzero()[:, 0].tolist()]
    if silent:
        raise ConfigError(f"the load has no effect on {', '.join(silent)}: their gains cannot be told")
    return _solve(sums, model)


def _solve(sums: Sums, model: TorqueModel) -> Gains:
    inverse_gains, parameters = _start(sums)
    for _ in range(_REPETITIONS):
        system = _System(sums, inverse_gains, parameters)
        step, inverse = solve(system.normal, system.gradient, _LEAST)
        change = _damped(system, step)
        parameters = parameters + change[: -model.joints]
        inverse_gains = inverse_gains + change[-model.joints :]
        if (change[-model.joints :] / inverse_gains).abs().max() < _SETTLED:
            break
    gains = 1 / inverse_gains
    deviation = inverse.diagonal()[-model.joints :].sqrt() * gains.square()
    return Gains(gains, deviation, parameters)


def _start(sums: Sums) -> tuple[Tensor, Tensor]:
    """Inverse gains and parameters from k_j i_j − Y_j θ = y_load: linear, but biased by noisy currents."""
    joints, count = sums.moment.shape
    normal = torch.zeros(count - 1 + joints, count - 1 + joints, dtype=torch.float64)
    normal[: count - 1, : count - 1] = sums.information[:, :-1, :-1].sum(0)
    normal[: count - 1, count - 1 :] = -sums.moment[:, :-1].T
    normal[count - 1 :, : count - 1] = -sums.moment[:, :-1]
    normal[count - 1 :, count - 1 :] = torch.diag(sums.energy)
    right = torch.cat([-sums.information[:, :-1, -1].sum(0), sums.moment[:, -1]])
    found, _ = solve(normal, right, _LEAST)
    return 1 / found[count - 1 :], found[: count - 1]


class _System:
    """Gauss-Newton's equations at some inverse gains (J,) and parameters (P,), from sums of [Y, y_load]."""

    def __init__(self, sums: Sums, inverse_gains: Tensor, parameters: Tensor) -> None:
        self._sums, self._k, self._x = sums, inverse_gains, parameters
        whole = torch.cat([parameters, torch.ones(1, dtype=torch.float64)])
        reach = sums.information @ whole
        power, match = reach @ whole, sums.moment @ whole
        self._weights = sums.weight / self._squares(inverse_gains, parameters)
        w, k = self._weights, inverse_gains
        top = torch.einsum("j,jpq->pq", w * k.square(), sums.information[:, :-1, :-1])
        side = (w * k)[:, None] * reach[:, :-1]
        low = torch.diag(w * power)
        self.normal = torch.cat([torch.cat([top, side.T], 1), torch.cat([side, low], 1)])
        pull = torch.einsum("j,jp->p", w * k, sums.moment[:, :-1] - k[:, None] * reach[:, :-1])
        self.gradient = torch.cat([pull, w * (match - k * power)])

    def cost(self, step: Tensor) -> float:
        """Weighted squares of the current's residuals after a step, with the weights of before."""
        joints = len(self._k)
        return float(self._weights @ self._squares(self._k + step[-joints:], self._x + step[:-joints]))

    def _squares(self, k: Tensor, x: Tensor) -> Tensor:
        sums, whole = self._sums, torch.cat([x, torch.ones(1, dtype=torch.float64)])
        found = sums.energy - 2 * k * (sums.moment @ whole) + k.square() * (sums.information @ whole @ whole)
        return torch.maximum(found, _ROUNDING * sums.energy)


def _damped(system: _System, step: Tensor) -> Tensor:
    """The step, shortened until it does not lead uphill."""
    now = system.cost(torch.zeros_like(step))
    for _ in range(_HALVINGS):
        if system.cost(step) <= now * (1 + _SETTLED):
            break
        step = step / 2
    return step
