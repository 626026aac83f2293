"""Samples of a model, piece by piece: their sums, residuals and reach."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel, torques_of
from sidegan.identification.sums import Sums, no_sums, sums_of


class Reach(NamedTuple):
    """Range and speed of each joint's motion, (J,) each."""

    range: Array  # from the lowest to the highest position [rad or m]
    fastest: Array  # highest speed [rad/s or m/s]


class Linear(Protocol):
    """A model of J joints whose torques are linear in its P parameters."""

    joints: int
    count: int  # P

    def regressor(self, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Regressor, (S, J, P), of states (S, J); see ``TorqueModel``."""


class Extended:
    """A model with further columns, which come last: ``columns(q, dq, ddq, sign)``, (S, J, K)."""

    def __init__(self, model: TorqueModel, count: int, columns: Callable[..., Array]) -> None:
        self._model = model
        self._columns = columns
        self.joints = model.joints
        self.count = model.count + count

    def regressor(self, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Regressor, (S, J, P + K), of states (S, J)."""
        y = self._model.regressor(q, dq, ddq, sign)
        return np.concatenate([y, self._columns(q, dq, ddq, sign)], 2)


@dataclass(frozen=True)
class Gathered:
    """Samples and the sums over them that methods fit parameters to."""

    sums: Sums  # over all samples
    pieces: list[Measurements]  # without gaps
    reach: Reach  # of the motion


def gather(model: Linear, measurements: Samples) -> Gathered:
    """Sums over the measurements of one or several recordings.

    Raises:
        ShapeError: when there are no samples, or they do not fit the model or are too large.
    """
    parts = list(pieces(measurements))
    if not parts:
        raise ShapeError("there are no samples to identify from")
    sums = no_sums(model.joints, model.count)
    with np.errstate(over="ignore"):  # the check below refuses it
        for part in parts:
            sums = sums.plus(_sums(model, part))
    if not all(np.isfinite(x).all() for x in sums):
        raise ShapeError(
            "the regressor or the torque holds a value that is not finite or too large to square"
        )
    low = np.min([x.position.min(0) for x in parts], 0)
    high = np.max([x.position.max(0) for x in parts], 0)
    fastest = np.max([np.abs(x.velocity).max(0) for x in parts], 0)
    return Gathered(sums, parts, Reach(high - low, fastest))


def residual_of(model: Linear, part: Measurements, parameters: Array) -> Array:
    """Residual τ − Y θ [N·m or N], (S, J), of a piece."""
    return part.torque - torques_of(_regressor(model, part), parameters)


def _sums(model: Linear, part: Measurements) -> Sums:
    if not isinstance(model, TorqueModel) or model.kinds or part.joints != model.joints:
        return sums_of(_regressor(model, part), part.torque)
    # For rigid bodies alone the same sums need no regressor in memory.
    products = model.body.sums(*part.states, part.torque)
    information, moment, energy = products[:, :-1, :-1], products[:, :-1, -1], products[:, -1, -1]
    return Sums(information, moment, energy, part.torque.sum(0), np.array(float(len(part))))


def _regressor(model: Linear, part: Measurements) -> Array:
    if part.joints != model.joints:
        raise ShapeError(f"measurements have {part.joints} joints, the model has {model.joints}")
    return model.regressor(*part.inputs)
