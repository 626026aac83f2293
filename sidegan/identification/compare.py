"""Two identifications of one kind of arm: what differs beyond their errors, and what torque that makes."""

from dataclasses import dataclass

import scipy  # its parts are imported when they are used
import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.identification.model import TorqueModel

_CLEAR = 4.0  # deviations from which a parameter differs
_SAME = 1e-3  # probability of a difference this large by chance, below which the models differ
_ROUNDING = 1e-10  # relative eigenvalue of a covariance that is no direction


@dataclass(frozen=True, eq=False)
class Comparison:
    """What differs between two identified models, the second less the first."""

    names: tuple[str, ...]  # of the parameters, (P,)
    difference: Tensor  # of each, (P,)
    deviation: Tensor  # standard deviation of that, (P,)
    probability: float  # of differences this large by chance
    torque: Tensor  # root mean square difference of torques over the first one's torques, (J,)
    uncertain: Tensor  # the same of the difference's errors, (J,)

    @property
    def differ(self) -> bool:
        """Whether the models differ beyond doubt."""
        return self.probability < _SAME

    @property
    def clear(self) -> list[tuple[str, float, float]]:
        """Parameters that differ beyond doubt, the clearest first: name, difference and deviation."""
        ratio = self.difference / self.deviation.clamp_min(1e-300)
        order = ratio.abs().argsort(descending=True).tolist()
        each = [(self.names[k], float(self.difference[k]), float(self.deviation[k])) for k in order]
        return [(name, x, sigma) for name, x, sigma in each if abs(x) > _CLEAR * sigma]


def compare(model: TorqueModel, first: tuple[Tensor, Tensor], second: tuple[Tensor, Tensor]) -> Comparison:
    """The difference of two estimates of a model, each parameters (P,) and the covariance of their errors.

    Errors of both are independent. All differences together are judged by χ², in the directions that the
    covariances tell.

    Raises:
        ShapeError: when an estimate does not fit the model.
    """
    for parameters, covariance in (first, second):
        if parameters.shape != (model.count,) or covariance.shape != (model.count, model.count):
            raise ShapeError(f"estimates of {model.count} parameters are expected, got {len(parameters)}")
    difference, covariance = second[0] - first[0], first[1] + second[1]
    deviation = covariance.diagonal().clamp_min(0).sqrt()
    scale = torch.where(deviation > 0, deviation, torch.ones_like(deviation))
    values, vectors = torch.linalg.eigh(covariance / scale / scale[:, None])
    kept = values > _ROUNDING * values[-1]
    along = vectors[:, kept].T @ (difference / scale)
    distance = float((along.square() / values[kept]).sum())
    y = model.usual_rows(seed=2)
    usual = (y @ first[0]).square().mean(0).sqrt().clamp_min(1e-300)
    uncertain = torch.einsum("sjp,pq,sjq->j", y, covariance, y).clamp_min(0) / len(y)
    return Comparison(
        names=tuple(model.names),
        difference=difference,
        deviation=deviation,
        probability=float(scipy.stats.chi2.sf(distance, int(kept.sum()))),
        torque=(y @ difference).square().mean(0).sqrt() / usual,
        uncertain=uncertain.sqrt() / usual,
    )
