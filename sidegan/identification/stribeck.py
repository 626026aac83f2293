"""At which velocity the extra friction near rest fades: the one thing of a model that is not linear."""

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from sidegan.errors import ConfigError
from sidegan.identification.fit import reweighted
from sidegan.identification.gather import gather
from sidegan.identification.linear import restricted
from sidegan.identification.measurements import SAMPLES_AT_ONCE, Samples
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums

_LEAST = 1e-6  # information on each parameter beside the samples'
_ROUNDS = 10


class _Candidates:
    """The model with one Stribeck column per joint and candidate velocity behind its own columns."""

    def __init__(self, model: TorqueModel, candidates: Sequence[float]) -> None:
        self._plain = TorqueModel(model.body, replace(model.terms, stribeck=False))
        self._width, self._velocities = model.terms.sign_width, candidates
        self.joints, self.rows = model.joints, self._plain.count
        extras = [f"fs{j + 1}@{v}" for v in candidates for j in range(model.joints)]
        self.names = [*self._plain.names, *extras]
        self.count = len(self.names)

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor, sign: Tensor | None = None) -> Tensor:
        plain = self._plain.regressor(q, dq, ddq, sign)
        sign = torch.tanh(dq / self._width) if sign is None else sign
        columns = [torch.diag_embed(sign * torch.exp(-((dq / v) ** 2))) for v in self._velocities]
        return torch.cat([plain, *columns], 2)


def stribeck_velocities(
    model: TorqueModel,
    measurements: Samples,
    candidates: Sequence[float] = (0.02, 0.05, 0.1, 0.2, 0.4),
    samples_at_once: int = SAMPLES_AT_ONCE,
) -> list[float]:
    """Velocity [rad/s or m/s] of each joint's Stribeck term that explains the measurements best, (J,).

    All candidates' columns go through the samples at once; from the sums, joint after joint takes the
    candidate of least weighted residual until none changes. Give them to ``TorqueModel``.

    Args:
        model: what else torque is explained with.
        measurements: one recording, several, or a stream of them.
        candidates: velocities to choose from.
        samples_at_once: largest number of samples whose regressor is held.

    Raises:
        ConfigError: when there is no candidate or one is not positive; otherwise as ``estimate``.
    """
    if not candidates or not all(v > 0 for v in candidates):
        raise ConfigError(f"candidate velocities are {list(candidates)}, expected some above zero")
    wide = _Candidates(model, candidates)
    sums = gather(wide, measurements, samples_at_once).sums
    weights = reweighted(sums, _LEAST).weights
    chosen = [len(candidates) // 2] * model.joints
    for _ in range(_ROUNDS):
        before = list(chosen)
        for joint in range(model.joints):
            tried = [[*chosen[:joint], k, *chosen[joint + 1 :]] for k in range(len(candidates))]
            misfits = [_misfit(sums, weights, wide, one) for one in tried]
            chosen[joint] = misfits.index(min(misfits))
        if chosen == before:
            break
    return [candidates[k] for k in chosen]


def _misfit(sums: Sums, weights: Tensor, wide: _Candidates, chosen: Sequence[int]) -> float:
    """Weighted squares of the residuals with one candidate per joint."""
    behind = [wide.rows + k * wide.joints + joint for joint, k in enumerate(chosen)]
    fit = restricted(sums, weights, torch.tensor([*range(wide.rows), *behind]), _LEAST)
    return float(weights.square() @ sums.squares(fit.parameters))
