"""Errors of predicted torques."""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.identification.estimate import estimate
from sidegan.identification.gather import residual_of
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel

_CONSTANT = 1e-12  # of the largest torque: a smaller deviation is rounding, not a signal
_LEAST_SHOWN = 1e-3  # smallest error with four decimals


def shown(nmse: float) -> str:
    """A mean nMSE as text: four decimals, or two significant digits if it is small."""
    return f"{nmse:.4f}" if nmse >= _LEAST_SHOWN else f"{nmse:.2g}"


class Score(NamedTuple):
    """Errors of predicted torques of each joint, (J,), or of each recording and joint, (K, J)."""

    nmse: Array  # mean((τ − τ̂)²) / var(τ); predicting the mean gives 1
    rmse: Array  # root mean square of τ − τ̂ [N·m or N]

    @property
    def nmse_mean(self) -> float:
        """Mean over joints."""
        return float(self.nmse.mean())

    @property
    def pooled(self) -> "Score":
        """Errors over all K recordings, (J,)."""
        return Score(self.nmse.mean(0), np.sqrt(np.square(self.rmse).mean(0)))


def score(model: TorqueModel, parameters: Array, measurements: Samples) -> Score:
    """Errors of the torques that parameters (P,) predict for measurements.

    Raises:
        ShapeError: when shapes do not fit the model, there are no samples, or a joint's torque is constant.
    """
    if parameters.shape != (len(model.names),):
        raise ShapeError(f"parameters are {parameters.shape}, the model has {len(model.names)}")
    parts = [(part.torque, residual_of(model, part, parameters)) for part in pieces(measurements)]
    if not sum(len(torque) for torque, _ in parts):
        raise ShapeError("there are no samples to test with")
    torque, residual = (np.concatenate(x) for x in zip(*parts))
    variance = torque.var(0)
    squares = np.square(residual).mean(0)
    constant = np.flatnonzero(np.sqrt(variance) <= _CONSTANT * np.abs(torque).max())
    if len(constant):
        raise ShapeError(f"the torque of joints {(constant + 1).tolist()} is constant: nMSE is not defined")
    return Score(squares / variance, np.sqrt(squares))


def folds(
    method: str, model: TorqueModel, recordings: Sequence[list[Measurements]], strength: float | None = None
) -> Score:
    """Errors, (K, J), of predicting each of K recordings with the model identified from the others."""
    rows = []
    for k, held_out in enumerate(recordings):
        others = chain(*recordings[:k], *recordings[k + 1 :])
        parameters = estimate(method, model, others, strength).parameters
        rows.append(score(model, parameters, held_out))
    return Score(*(np.stack(column) for column in zip(*rows)))
