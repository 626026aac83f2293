"""Quality of an identified model: its errors, its uncertain parameters, and the description beside it."""

import torch
from torch import Tensor

from sidegan.identification.estimate import Estimate
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.score import Score, score, score_of_sums
from sidegan.identification.sums import solve
from sidegan.identification.verdict import Quality

_LEAST = 1e-6  # information on each term beside the samples'
_EFFECT = 0.1  # a parameter is weak when one deviation of it makes more than this share of a joint's torque


def quality(
    model: TorqueModel,
    estimate: Estimate,
    validation: list[Measurements] | None = None,
    folds: Score | None = None,
) -> Quality:
    """Quality of an estimate of a model, from which its verdict follows.

    Raises:
        ShapeError: when a joint's validation torque is constant.
    """
    per_unit, torque_deviation, usual = _effects(model, estimate)
    effect = per_unit * estimate.deviation
    weak = [i for i in effect.argsort(descending=True).tolist() if effect[i] > _EFFECT]
    candidates = estimate.parameters, _nominal_fit(model, estimate)
    train, nominal = (score_of_sums(estimate.sums, x) for x in candidates)
    validated = None
    if validation is not None:
        validated, nominal = (score(model, x, validation) for x in candidates)
    return Quality(
        arm=model.arm,
        estimate=estimate,
        train=train,
        validation=validated,
        nominal_score=nominal,
        folds=folds,
        torque_deviation=torque_deviation,
        usual=usual,
        weak=tuple(estimate.names[i] for i in weak),
    )


def _effects(model: TorqueModel, estimate: Estimate) -> tuple[Tensor, Tensor, Tensor]:
    """Share of usual torques per unit of each parameter, (P,), of their deviation, (J,), and these, (J,).

    Usual is the root mean square over random states within the limits, at half the arm's pace.
    """
    y = model.regressor(*model.usual_states())
    usual = (y @ estimate.parameters).square().mean(0).sqrt().clamp_min(torch.finfo(torch.float64).tiny)
    share = y.square().mean(0).sqrt() / usual[:, None]
    variance = torch.einsum("sjp,pq,sjq->j", y, estimate.covariance, y).clamp_min(0) / len(y)
    return share.amax(0), variance.sqrt() / usual, usual


def _nominal_fit(model: TorqueModel, estimate: Estimate) -> Tensor:
    """The description's link parameters with everything else fitted, (P,)."""
    r, nominal = model.rigid, model.nominal.clone()
    information, moment = estimate.sums.weighted(estimate.weights)
    rest = moment[r:] - information[r:, :r] @ nominal[:r]
    if len(rest):
        nominal[r:], _ = solve(information[r:, r:], rest, _LEAST)
    return nominal
