"""Test whether a model's residuals are sensor noise rather than something that a model could explain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.identification.fit import spread_of
from sidegan.identification.measurements import Measurements, pieces
from sidegan.identification.model import TorqueModel, torques_of
from sidegan.recording.check import CheckedRecording
from sidegan.recording.recording import Segment

_BANDS = ((0.0, 0.3), (0.3, 0.6))  # shares of the cut-off; most unmodelled torque is in the first band
_LEAST = 15.0  # independent values that a band needs for a test
_RARE = 1e-3  # false alarm rate per band of pure noise
_EXPECTED = 1.25  # allowance for the error of the expected noise
_HANN = 35 / 18  # correlated spectral values per independent one, under a Hann window
_ALIKE = 4.0  # standard deviations at which a correlation between neighbours is significant


class _Residual(NamedTuple):
    """Residual torques of a segment, and the noise expected in them."""

    energy: Array  # in each band, (K, J)
    expected: Array  # energy of noise and of the parameters' errors, (K, J)
    values: Array  # number of independent values in each band, (K,)
    samples: Array  # independent samples of the residual and of the signals it is sorted by, (5, N, J)


def is_noise(
    model: TorqueModel, parameters: Array, covariance: Array, recordings: Sequence[CheckedRecording]
) -> Array:
    """Whether each joint's residuals with parameters (P,) are noise, (J,).

    They are if in each band below the cut-off they are no larger than the torques above it, up to errors of
    the parameters with a covariance (P, P), and if residuals at neighbouring positions, velocities,
    accelerations or torques are uncorrelated. False if there are too few samples to decide.
    """
    residuals = [
        _residual(model, parameters, covariance, segment, recording.grid.cutoff, recording.noise)
        for recording in recordings
        for segment in recording.segments
    ]
    energy, expected, values = (np.stack(x).sum(0) for x in list(zip(*residuals))[:3])
    if (values < _LEAST).any():
        return np.zeros(model.joints, dtype=bool)
    most = _EXPECTED * scipy.stats.chi2.isf(_RARE, values) / values
    as_large = energy <= most[:, None] * expected  # False where the noise is unknown (NaN)
    return as_large.all(0) & _uncorrelated(np.concatenate([residual.samples for residual in residuals], 1))


def _residual(
    model: TorqueModel, parameters: Array, covariance: Array, segment: Segment, cutoff: float, noise: Array
) -> _Residual:
    """Residual of a segment with a low-pass [Hz], from the noise density of its torques, (J,)."""
    rate = 1 / float(segment.time[1] - segment.time[0])
    count = len(segment.time)
    predicted = []
    errors = np.zeros(model.joints)
    for part in pieces(Measurements(*segment[1:])):
        y = model.regressor(*part.inputs)
        predicted.append(torques_of(y, parameters))
        errors += spread_of(y, covariance) / count
    torque = np.concatenate(predicted)
    residual = segment.torque - torque
    window = np.hanning(count + 1)[:-1]  # periodic
    power = np.square(np.abs(np.fft.rfft(window[:, None] * residual, axis=0)))
    share = np.fft.rfftfreq(count, 1 / rate) / cutoff
    unit = np.square(window).sum()
    inside = np.stack([(low <= share) & (share < high) for low, high in _BANDS])
    expected = inside.sum(1)[:, None] * noise * rate / 2 * unit
    expected[0] += errors * unit * count / 2
    step = max(1, round(rate / (2 * cutoff)))
    samples = np.stack([residual, segment.position, segment.velocity, segment.acceleration, torque])
    return _Residual(inside @ power, expected, 2 * inside.sum(1) / _HANN, samples[:, ::step])


def _uncorrelated(samples: Array) -> Array:
    """Whether residuals sorted by each of the other signals are uncorrelated with their neighbours, (J,)."""
    residual = samples[0]
    result = np.ones(samples.shape[2], dtype=bool)
    for x in samples[1:]:
        r = np.take_along_axis(residual, x.argsort(0), 0)
        r = r - r.mean(0)
        correlation = (r[1:] * r[:-1]).sum(0) / np.square(r).sum(0)
        result &= correlation * len(r) ** 0.5 < _ALIKE
    return result
