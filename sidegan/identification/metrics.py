"""How well an identified model predicts, and how sure it is."""

import torch
from torch import Tensor

from sidegan.errors import ShapeError

_CONSTANT = 1e-12  # of the largest torque: a smaller deviation is rounding, not a signal


def nmse(torque: Tensor, predicted: Tensor) -> Tensor:
    """Normalised mean squared error of each joint, mean((τ − τ̂)²) / var(τ), (J,).

    One is as good as predicting the mean; the tables report the mean over joints.

    Args:
        torque: test torques [N·m], (S, J).
        predicted: the model's torques for the same states, (S, J).

    Raises:
        ShapeError: when the two are not alike or not finite, or a joint's test torque is constant.
    """
    if torque.ndim != 2 or torque.shape != predicted.shape or not len(torque):
        raise ShapeError(
            f"torque {tuple(torque.shape)} and prediction {tuple(predicted.shape)}, expected (S, J)"
        )
    if not (torque.isfinite().all() and predicted.isfinite().all()):
        raise ShapeError("test torques and predictions must be finite")
    deviation = torque.std(0, correction=0)
    constant = (deviation <= _CONSTANT * torque.abs().max()).nonzero()[:, 0]
    if len(constant):
        raise ShapeError(
            f"the test torque of joints {(constant + 1).tolist()} is constant: nMSE is not defined"
        )
    return (torque - predicted).square().mean(0) / deviation.square()


def covariance_norm(covariance: Tensor) -> float:
    """Norm of the covariance's diagonal, ‖diag P‖₂.

    Raises:
        ShapeError: when the covariance is not square.
    """
    if covariance.ndim != 2 or covariance.shape[0] != covariance.shape[1]:
        raise ShapeError(f"covariance is {tuple(covariance.shape)}, expected (p, p)")
    return float(torch.linalg.vector_norm(covariance.diagonal()))
