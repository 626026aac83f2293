"""At which velocity the extra friction near rest fades: the one thing of a model that is not linear."""

from collections.abc import Sequence
from functools import reduce

import torch
from torch import Tensor

from sidegan.errors import ConfigError
from sidegan.identification.fit import reweighted
from sidegan.identification.linear import restricted
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums, sums_of

_LEAST = 1e-6  # information on each parameter beside the samples'
_ROUNDS = 10


def stribeck_velocities(
    model: TorqueModel, measurements: Samples, candidates: Sequence[float] = (0.02, 0.05, 0.1, 0.2, 0.4)
) -> list[float]:
    """Velocity [rad/s or m/s] of each joint's Stribeck term that explains the measurements best, (J,).

    All candidates' columns go through the samples at once; from the sums, joint after joint takes the
    candidate of least weighted residual until none changes. Give them to ``TorqueModel``.

    Args:
        model: what else torque is explained with, without a Stribeck term.
        measurements: one recording, several, or a stream of them.
        candidates: velocities to choose from.

    Raises:
        ConfigError: when there is no candidate or one is not positive.
    """
    if not candidates or not all(v > 0 for v in candidates):
        raise ConfigError(f"candidate velocities are {list(candidates)}, expected some above zero")
    parts = (sums_of(_regressor(model, x, candidates), x.torque.double()) for x in pieces(measurements))
    sums = reduce(Sums.plus, parts)
    weights = reweighted(sums, _LEAST).weights
    chosen = [len(candidates) // 2] * model.joints
    for _ in range(_ROUNDS):
        before = list(chosen)
        for joint in range(model.joints):
            trials = [[*chosen[:joint], k, *chosen[joint + 1 :]] for k in range(len(candidates))]
            misfits = [_misfit(sums, weights, model, one) for one in trials]
            chosen[joint] = misfits.index(min(misfits))
        if chosen == before:
            break
    return [candidates[k] for k in chosen]


def _regressor(model: TorqueModel, part: Measurements, candidates: Sequence[float]) -> Tensor:
    """The model's regressor with one Stribeck column per joint and candidate velocity behind it."""
    _, dq, _, *given = inputs = [x.double() for x in part.inputs]
    sign = given[0] if given else torch.tanh(dq / model.terms.sign_width)
    columns = [torch.diag_embed(sign * torch.exp(-((dq / v) ** 2))) for v in candidates]
    return torch.cat([model.regressor(*inputs), *columns], 2)


def _misfit(sums: Sums, weights: Tensor, model: TorqueModel, chosen: Sequence[int]) -> float:
    """Weighted squares of the residuals with one candidate per joint."""
    behind = [model.count + k * model.joints + joint for joint, k in enumerate(chosen)]
    fit = restricted(sums, weights, torch.tensor([*range(model.count), *behind]), _LEAST)
    return float(weights.square() @ sums.squares(fit.parameters))
