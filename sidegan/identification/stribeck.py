"""Velocities of the Stribeck term, in which a model is not linear, from the samples."""

from collections.abc import Sequence
from functools import reduce

import torch
from torch import Tensor

from sidegan.identification.fit import reweighted
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums, solve, sums_of

_STRIBECK = (0.02, 0.05, 0.1, 0.2, 0.4)  # velocities [rad/s or m/s] that the term's is chosen from
_LEAST = 1e-6  # information on each parameter beside the samples'
_ROUNDS = 10


def stribeck_velocities(model: TorqueModel, measurements: Samples) -> list[float]:
    """Velocity [rad/s or m/s] of each joint's Stribeck term that explains the measurements best, (J,).

    All candidates' columns go through the samples at once; from the sums, joint after joint takes the
    candidate of least weighted residual until none changes. The model is without a Stribeck term.
    """
    parts = (sums_of(_with_stribeck(model, x), x.torque.double()) for x in pieces(measurements))
    sums = reduce(Sums.plus, parts)
    weights = reweighted(sums, _LEAST).weights
    chosen = [len(_STRIBECK) // 2] * model.joints
    for _ in range(_ROUNDS):
        before = list(chosen)
        for joint in range(model.joints):
            trials = [[*chosen[:joint], k, *chosen[joint + 1 :]] for k in range(len(_STRIBECK))]
            misfits = [_misfit(sums, weights, model, one) for one in trials]
            chosen[joint] = misfits.index(min(misfits))
        if chosen == before:
            break
    return [_STRIBECK[k] for k in chosen]


def _with_stribeck(model: TorqueModel, part: Measurements) -> Tensor:
    """The model's regressor with one Stribeck column per joint and candidate velocity behind it."""
    _, dq, _, *given = inputs = [x.double() for x in part.inputs]
    sign = given[0] if given else torch.tanh(dq / model.terms.sign_width)
    columns = [torch.diag_embed(sign * torch.exp(-((dq / v) ** 2))) for v in _STRIBECK]
    return torch.cat([model.regressor(*inputs), *columns], 2)


def _misfit(sums: Sums, weights: Tensor, model: TorqueModel, chosen: Sequence[int]) -> float:
    """Weighted squares of the residuals with one candidate per joint."""
    behind = [model.count + k * model.joints + joint for joint, k in enumerate(chosen)]
    kept = torch.tensor([*range(model.count), *behind])
    information, moment = sums.weighted(weights)
    parameters = torch.zeros_like(moment)
    parameters[kept], _ = solve(information[kept[:, None], kept], moment[kept], _LEAST)
    return float(weights.square() @ sums.squares(parameters))
