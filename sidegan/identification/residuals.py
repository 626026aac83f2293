"""Residuals of a model: noise, or effects that it lacks, with their kinds, sizes and errors.

An unmodelled torque b changes the least-squares parameters by B b. What remains, b − Y B b, is in the
residuals; at other states the same expression is the error of the prediction. More motion of the same kind
reduces the error due to noise, but not this one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import TINY, Array
from sidegan.identification import thresholds
from sidegan.identification.effects import EFFECT_KINDS, PLACES, forms
from sidegan.identification.estimate import Estimate
from sidegan.identification.fit import spread_of
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel, torques_of
from sidegan.identification.sums import scaled_inverse
from sidegan.recording.checked import CheckedRecording
from sidegan.recording.recording import Segment

BIASED = "bias dominates"

_BANDS = ((0.0, 0.3), (0.3, 0.6))  # shares of the cut-off; most unmodelled torque is in the first band
_HANN = 35 / 18  # correlated spectral values per independent one, under a Hann window

_MOST = 3  # kinds per joint, at most
_LOST = 1e-6  # relative eigenvalue below which forms are not separable


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
    energy = np.sum([x.energy for x in residuals], 0)
    expected = np.sum([x.expected for x in residuals], 0)
    values = np.sum([x.values for x in residuals], 0)
    if (values < thresholds.LEAST_VALUES).any():
        return np.zeros(model.joints, dtype=bool)
    most = thresholds.EXPECTED_NOISE * scipy.stats.chi2.isf(thresholds.FALSE_ALARMS, values) / values
    as_large = energy <= most[:, None] * expected  # False where the noise is unknown (NaN)
    return as_large.all(0) & _uncorrelated(np.concatenate([x.samples for x in residuals], 1))


class _Residual(NamedTuple):
    """Residual of a segment, in K bands."""

    energy: Array  # (K, J)
    expected: Array  # energy of noise and of the parameters' errors, (K, J)
    values: Array  # number of independent values, (K,)
    samples: Array  # independent ones of it, and of signals to sort it by, (5, N, J)


def _residual(
    model: TorqueModel, parameters: Array, covariance: Array, segment: Segment, cutoff: float, noise: Array
) -> _Residual:
    """Residual of a segment with a low-pass [Hz] and noise of a density, (J,)."""
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
        result &= correlation * len(r) ** 0.5 < thresholds.CORRELATED
    return result


class Lack(NamedTuple):
    """A kind of unmodelled torque in one joint."""

    joint: int
    kind: str  # in words
    share: float  # of the variance of the joint's residuals


@dataclass(frozen=True)
class Unmodelled:
    """Unmodelled torques of an arm."""

    found: tuple[Lack, ...]  # by joint, then largest share first
    error: Array  # resulting torque errors in other motions, relative to the usual torque, (J,)

    def sentences(self, names: Sequence[str], noise: Array) -> list[str]:
        """A sentence for each joint with unmodelled torques; ``noise`` is the error due to noise, (J,)."""
        sentences = []
        for j, name in enumerate(names):
            if kinds := [f"{lack.share:.0%} {lack.kind}" for lack in self.found if lack.joint == j]:
                kinds[0] = kinds[0].replace("%", "% of the residual is", 1)
                sentences.append(
                    f"{name}: {', '.join(kinds)}, more than noise explains; torque errors in other "
                    f"motions: {self.error[j]:.1%} from unmodelled effects, {noise[j]:.1%} from noise: "
                    f"{BIASED if self.error[j] > noise[j] else 'noise dominates'}"
                )
        return sentences or [
            "no known effect explains more of the residual than noise would: more motion helps"
        ]


def find_unmodelled(model: TorqueModel, estimate: Estimate, samples: Samples) -> Unmodelled:
    """Unmodelled torques of an estimate, from its residuals on the samples it was fitted to.

    A kind counts if it explains several times as much of the residuals as it would of noise with the same
    variance and correlation. The samples are read once.
    """
    turned, normals = _normals(model, estimate, samples)
    each = [_explained(normal, x) for normal, x in zip(normals, estimate.inflation / estimate.samples)]
    found = [Lack(j, *kind) for j, (kinds, _) in enumerate(each) for kind in kinds]
    amounts = np.stack([joint for _, joint in each])
    states = model.usual_states()
    rows = model.regressor(*states)
    torque = rows @ estimate.parameters
    forms = _forms(model, estimate, rows, Measurements(*states, torque))
    error = (forms * amounts).sum(2) - rows @ np.einsum("jpk,jk->p", turned, amounts)
    usual = np.maximum(np.square(torque).mean(0), TINY)
    return Unmodelled(tuple(found), np.sqrt(np.square(error).mean(0) / usual))


class _Normal(NamedTuple):
    """Normal equations of a joint's residuals in the part of its forms that the model cannot absorb."""

    normal: Array  # (K, K)
    right: Array  # (K,)
    energy: Array  # sum of squared residuals, ()

    def by(self, some: list[int]) -> tuple[float, Array]:
        """Sum of squared residuals that some forms explain, and the amplitude of each."""
        amounts = scaled_inverse(self.normal[some][:, some], _LOST) @ self.right[some]
        return float(amounts @ self.right[some]), amounts


def _explained(joint: _Normal, chance: float) -> tuple[list[tuple[str, float]], Array]:
    """Kinds that explain more than by chance, with their shares, and the amplitude of each form, (K,)."""
    found: dict[str, float] = {}
    chosen: list[int] = []
    reached = 0.0
    amounts = np.zeros_like(joint.right)
    while joint.energy > 0 and len(found) < _MOST:
        left = {kind: places for kind, places in PLACES.items() if EFFECT_KINDS[kind].words not in found}
        values = {kind: joint.by([*chosen, *places])[0] for kind, places in left.items()}
        best = max(values, key=values.__getitem__)
        share = (values[best] - reached) / float(joint.energy)
        if share < max(thresholds.NOTABLE_EFFECT, thresholds.BEYOND_CHANCE * chance * len(PLACES[best])):
            break
        found[EFFECT_KINDS[best].words] = share
        chosen += PLACES[best]
        reached, amounts[chosen] = joint.by(chosen)
    return [*found.items()], amounts


def _normals(model: TorqueModel, estimate: Estimate, samples: Samples) -> tuple[Array, list[_Normal]]:
    """Change B of the parameters per unit of each joint's forms, (J, P, K), and each joint's equations."""
    moments = products = np.zeros(())  # of columns with the regressor, (J, P, K + 1), and with themselves
    for part in pieces(samples):
        y = model.regressor(*part.inputs)
        residual = part.torque - torques_of(y, estimate.parameters)
        columns = np.concatenate([_forms(model, estimate, y, part), residual[..., None]], 2).swapaxes(0, 1)
        moments = moments + y.transpose(1, 2, 0) @ columns
        products = products + columns.mT @ columns
    moments, along = moments[..., :-1], moments[..., -1:]
    inverse = scaled_inverse(estimate.sums.weighted(estimate.weights)[0])
    turned = inverse @ (np.square(estimate.weights)[:, None, None] * moments)
    crossed, kept = moments.mT @ turned, turned.mT @ estimate.sums.information @ turned
    normal = products[:, :-1, :-1] - crossed - crossed.mT + kept
    right = products[:, :-1, -1] - (turned.mT @ along)[..., 0]
    return turned, [_Normal(*joint) for joint in zip(normal, right, products[:, -1, -1])]


def _forms(model: TorqueModel, estimate: Estimate, y: Array, part: Measurements) -> Array:
    """Torques of a unit of each form, (S, J, K), at samples with regressor y."""
    load = torques_of(y[..., : model.moved], estimate.parameters[: model.moved])
    usual = np.sqrt(np.maximum(estimate.sums.energy / estimate.sums.weight, TINY))
    sign = model.terms.sign(part.velocity) if part.sign is None else part.sign
    return np.moveaxis(forms(part.position, part.velocity, sign, load / usual), 0, -1)
