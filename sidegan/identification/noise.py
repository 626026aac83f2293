"""Whether what a model leaves of torques is the sensors' noise, and nothing that a model could explain."""

from collections.abc import Sequence
from typing import NamedTuple

import scipy  # its parts are imported when they are used
import torch
from torch import Tensor

from sidegan.identification.measurements import Measurements, pieces
from sidegan.identification.model import TorqueModel
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

    energy: Tensor  # in each band, (K, J)
    expected: Tensor  # of noise and of the parameters' errors, (K, J)
    values: Tensor  # independent ones in each band, (K,)
    samples: Tensor  # independent ones, residual and what it is sorted by, (5, N, J)


def is_noise(
    model: TorqueModel, parameters: Tensor, covariance: Tensor, recordings: Sequence[CheckedRecording]
) -> Tensor:
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
    energy, expected, values = (torch.stack(x).sum(0) for x in list(zip(*left))[:3])
    if (values < _LEAST).any():
        return torch.zeros(model.joints, dtype=torch.bool)
    most = _EXPECTED * torch.from_numpy(scipy.stats.chi2.isf(_RARE, values.numpy())) / values
    as_large = energy <= most[:, None] * expected  # never where the noise is not known
    return as_large.all(0) & _unlike(torch.cat([one.samples for one in left], 1))


def _left(
    model: TorqueModel, parameters: Tensor, covariance: Tensor, segment: Segment, cutoff: float, noise: Tensor
) -> _Left:
    """What is left of a segment after a low-pass [Hz], of torques with a density of noise, (J,)."""
    rate, count = 1 / float(segment.time[1] - segment.time[0]), len(segment.time)
    predicted, errors = [], torch.zeros(model.joints, dtype=torch.float64)
    for part in pieces(Measurements(*segment[1:])):
        y = model.regressor(*part.inputs)
        predicted.append(y @ parameters)
        errors += torch.einsum("sjp,pq,sjq->j", y, covariance, y).clamp_min(0) / count
    torque = torch.cat(predicted)
    residual, window = segment.torque - torque, torch.hann_window(count, dtype=torch.float64)
    power = torch.fft.rfft(window[:, None] * residual, dim=0).abs().square()
    share, unit = torch.fft.rfftfreq(count, 1 / rate, dtype=torch.float64) / cutoff, window.square().sum()
    inside = torch.stack([(low <= share) & (share < high) for low, high in _BANDS]).double()
    expected = inside.sum(1)[:, None] * noise * rate / 2 * unit
    expected[0] += errors * unit * count / 2
    every = max(1, round(rate / (2 * cutoff)))
    samples = torch.stack([residual, segment.position, segment.velocity, segment.acceleration, torque])
    return _Left(inside @ power, expected, 2 * inside.sum(1) / _HANN, samples[:, ::every])


def _unlike(samples: Tensor) -> Tensor:
    """Whether residuals next to each other by any of what they are sorted by are unlike, (J,)."""
    residual, unlike = samples[0], torch.ones(samples.shape[2], dtype=torch.bool)
    for x in samples[1:]:
        r = residual.gather(0, x.argsort(0))
        r = r - r.mean(0)
        alike = (r[1:] * r[:-1]).sum(0) / r.square().sum(0)
        unlike &= alike * len(r) ** 0.5 < _ALIKE
    return unlike
