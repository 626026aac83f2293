"""Errors of predicted torques."""

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.identification.estimate import estimate
from sidegan.identification.gather import residual_of
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums

_CONSTANT = 1e-12  # of the largest torque: a smaller deviation is rounding, not a signal
_LEAST_SHOWN = 1e-3  # of an error with four digits after the point


def shown(nmse: float) -> str:
    """A mean nMSE for people: four digits after the point, or two that count where these would be zeros."""
    return f"{nmse:.4f}" if nmse >= _LEAST_SHOWN else f"{nmse:.2g}"


class Score(NamedTuple):
    """Errors of predicted torques, of each joint (J,), or of each of K recordings, (K, J)."""

    nmse: Tensor  # mean((τ − τ̂)²) / var(τ); one is as good as predicting the mean
    rmse: Tensor  # root mean square of τ − τ̂ [N·m or N]

    @property
    def nmse_mean(self) -> float:
        """Mean over joints."""
        return float(self.nmse.mean())

    @property
    def pooled(self) -> "Score":
        """Errors over all K recordings, (J,)."""
        return Score(self.nmse.mean(0), self.rmse.square().mean(0).sqrt())


def score(model: TorqueModel, parameters: Tensor, measurements: Samples) -> Score:
    """Errors of the torques that parameters (P,) predict for measurements.

    Raises:
        ShapeError: when nothing fits the model, there are no samples, or a joint's torque is constant.
    """
    if parameters.shape != (len(model.names),):
        raise ShapeError(f"parameters are {tuple(parameters.shape)}, the model has {len(model.names)}")
    parts = [(part.torque.double(), residual_of(model, part, parameters)) for part in pieces(measurements)]
    if not sum(len(torque) for torque, _ in parts):
        raise ShapeError("there are no samples to test with")
    torque, residual = (torch.cat(x) for x in zip(*parts))
    variance, squares = torque.var(0, correction=0), residual.square().mean(0)
    constant = (variance.sqrt() <= _CONSTANT * torque.abs().max()).nonzero()[:, 0]
    if len(constant):
        raise ShapeError(f"the torque of joints {(constant + 1).tolist()} is constant: nMSE is not defined")
    return Score(squares / variance, squares.sqrt())


def score_of_sums(sums: Sums, parameters: Tensor) -> Score:
    """Errors from the sums over samples; infinite where a joint's torque is constant."""
    return Score(sums.nmse(parameters), (sums.squares(parameters) / sums.weight).sqrt())


def folds(
    method: str, model: TorqueModel, recordings: Sequence[list[Measurements]], **settings: Any
) -> Score:
    """Each of K recordings predicted by what was identified from all others, (K, J), as for ``estimate``."""
    rows = []
    for k, held_out in enumerate(recordings):
        others = chain(*recordings[:k], *recordings[k + 1 :])
        parameters = estimate(method, model, others, **settings).parameters
        rows.append(score(model, parameters, held_out))
    return Score(*(torch.stack(column) for column in zip(*rows)))
