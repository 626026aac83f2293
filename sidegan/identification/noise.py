"""Whether what a model leaves of torques is the sensors' noise, and nothing that a model could explain."""

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

_BANDS = ((0.0, 0.3), (0.3, 0.6))  # of the cut-off; in the first is most of what a model lacks
_LEAST = 15.0  # independent values of a band: of fewer nothing can be said
_RARE = 1e-3  # of the bands of pure noise may look like more
_EXPECTED = 1.25  # times the noise that is expected, for the error of that
_HANN = 35 / 18  # values of a spectrum under a Hann window that tell as much as one
_ALIKE = 4.0  # deviations of a correlation between neighbours that chance does not explain


class _Left(NamedTuple):
    """What is left of torques in a stretch, beside noise."""

    energy: Array  # in each band, (K, J)
    expected: Array  # of noise and of the parameters' errors, (K, J)
    values: Array  # independent ones in each band, (K,)
    samples: Array  # independent ones, residual and what it is sorted by, (5, N, J)


def is_noise(
    model: TorqueModel, parameters: Array, covariance: Array, recordings: Sequence[CheckedRecording]
) -> Array:
    """Whether what parameters (P,) leave of each joint's torque in recordings is noise, (J,).

    It is so where it is as large in each band below the cut-off as what the torques hold above it, up to the
    parameters' errors with a covariance (P, P), and where neighbours in position, velocity, acceleration or
    torque have nothing in common. What cannot be told is no noise.
    """
    left = [
        _left(model, parameters, covariance, segment, recording.grid.cutoff, recording.noise)
        for recording in recordings
        for segment in recording.segments
    ]
    energy, expected, values = (np.stack(x).sum(0) for x in list(zip(*left))[:3])
    if (values < _LEAST).any():
        return np.zeros(model.joints, dtype=bool)
    most = _EXPECTED * scipy.stats.chi2.isf(_RARE, values) / values
    as_large = energy <= most[:, None] * expected  # never where the noise is not known
    return as_large.all(0) & _unlike(np.concatenate([one.samples for one in left], 1))


def _left(
    model: TorqueModel, parameters: Array, covariance: Array, segment: Segment, cutoff: float, noise: Array
) -> _Left:
    """What is left of a segment after a low-pass [Hz], of torques with a density of noise, (J,)."""
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
    window = np.hanning(count + 1)[:-1]  # a periodic one
    power = np.square(np.abs(np.fft.rfft(window[:, None] * residual, axis=0)))
    share = np.fft.rfftfreq(count, 1 / rate) / cutoff
    unit = np.square(window).sum()
    inside = np.stack([(low <= share) & (share < high) for low, high in _BANDS])
    expected = inside.sum(1)[:, None] * noise * rate / 2 * unit
    expected[0] += errors * unit * count / 2
    every = max(1, round(rate / (2 * cutoff)))
    samples = np.stack([residual, segment.position, segment.velocity, segment.acceleration, torque])
    return _Left(inside @ power, expected, 2 * inside.sum(1) / _HANN, samples[:, ::every])


def _unlike(samples: Array) -> Array:
    """Whether residuals next to each other by any of what they are sorted by are unlike, (J,)."""
    residual = samples[0]
    unlike = np.ones(samples.shape[2], dtype=bool)
    for x in samples[1:]:
        r = np.take_along_axis(residual, x.argsort(0), 0)
        r = r - r.mean(0)
        alike = (r[1:] * r[:-1]).sum(0) / np.square(r).sum(0)
        unlike &= alike * len(r) ** 0.5 < _ALIKE
    return unlike
