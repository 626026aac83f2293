"""Zeros of joint positions that are not the description's, found by what they would explain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array, geometric_mean
from sidegan.identification.fit import covariance_of, reweighted, torque_errors
from sidegan.identification.gather import gather
from sidegan.identification.measurements import Measurements, thinned
from sidegan.identification.model import TorqueModel

_SAMPLES = 2_000  # enough to find a zero
_STEP = 1e-4  # [rad or m] of a difference quotient
# [rad or m] unit of a change of zero: its prior deviation, of ``fit.LEAST``, is then 0.1 rad. Links explain
# some changes, as that of the last joint, exactly, and with a much weaker prior: these changes stay zero
_UNIT = 1e-4
_ROUNDS = 12  # of Gauss–Newton
_FARTHEST = 0.3  # [rad or m] change in a round
_SETTLED = 1e-3  # [rad or m] change that ends the rounds
_NOTABLE = 0.05  # [rad or m] smallest difference reported
_SURE = 5.0  # standard deviations from zero at which a difference is significant
_EXPLAINED = 0.7  # largest share of the residuals' squares that may remain, geometric mean over joints
_ALIKE = 0.5  # largest difference between parts of the samples, relative to the zero's


def shifted_zeros(model: TorqueModel, samples: Sequence[Measurements]) -> Array:
    """Positions [rad or m] that a recording has where the description has zero, (J,); 0 where they agree.

    Links and terms of the model are fitted anew with them. They are believed if they are significant and
    explain the residuals in both halves of the samples; those that links can make up for cannot be found.
    """
    whole = thinned(samples, _SAMPLES)
    every = np.ones(model.joints, dtype=bool)
    first = _fitted(model, whole, every)
    clear = np.abs(first.zeros) > np.maximum(_NOTABLE, _SURE * first.deviation)
    if not clear.any():
        return np.zeros(model.joints)
    half = len(whole) // 2
    found, *halves = (_fitted(model, x, clear) for x in (whole, whole[:half], whole[half:]))
    zeros = np.where(clear, found.zeros, 0.0)
    alike = all((np.abs(part.zeros - zeros) <= _ALIKE * np.abs(zeros))[clear].all() for part in halves)
    explained = all(part.left < _EXPLAINED for part in (found, *halves))
    return zeros if alike and explained else np.zeros(model.joints)


def moved(samples: Sequence[Measurements], zeros: Array | float) -> list[Measurements]:
    """Samples whose positions count from other zeros [rad or m], (J,)."""
    signals = [vars(x) | {"position": x.position - zeros} for x in samples]
    return [Measurements(**x) for x in signals]


class _Fitted(NamedTuple):
    zeros: Array  # [rad or m], (J,)
    deviation: Array  # of each, (J,)
    left: float  # share of the residuals' squares that remains, geometric mean over joints


def _fitted(model: TorqueModel, samples: Measurements, free: Array) -> _Fitted:
    """Zeros of the free joints, (J,) marked, fitted together with the model's parameters."""
    joints = model.joints
    zeros = np.zeros(joints)
    plain = gather(model, samples).sums
    parameters = reweighted(plain).parameters
    before = plain.squares(parameters)
    for _ in range(_ROUNDS):
        shifted = _Shifted(model, parameters, free)
        data = gather(shifted, moved([samples], zeros))
        fit = reweighted(data.sums)
        parameters, change = fit.parameters[:-joints], _UNIT * fit.parameters[-joints:]
        zeros = zeros + np.clip(change, -_FARTHEST, _FARTHEST)
        if np.abs(change).max() < _SETTLED:
            break
    covariance = covariance_of(data.sums, fit, torque_errors(data, fit))
    deviation = _UNIT * np.sqrt(np.maximum(covariance.diagonal()[-joints:], 0))
    shares = data.sums.squares(fit.parameters) / np.maximum(before, np.finfo(float).tiny)
    return _Fitted(zeros, deviation, geometric_mean(np.maximum(shares, 1e-12)))


class _Shifted:
    """A model and small changes of the joints' zeros, whose columns come last, in units of ``_UNIT``."""

    def __init__(self, model: TorqueModel, parameters: Array, free: Array) -> None:
        self._model, self._parameters, self._free = model, parameters, free
        self.joints = model.joints
        self.count = model.count + model.joints

    def regressor(self, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Regressor, (S, J, P + J), of states (S, J)."""
        added = np.zeros((len(q), self.joints, self.joints))
        for j in np.flatnonzero(self._free):
            step = _STEP * np.eye(self.joints)[j]
            ends = q - step, q + step
            less, more = (self._model.torque(self._parameters, x, dq, ddq, sign) for x in ends)
            added[:, :, j] = _UNIT * (less - more) / (2 * _STEP)
        return np.concatenate([self._model.regressor(q, dq, ddq, sign), added], 2)
