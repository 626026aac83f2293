"""Whether to trust an identified model: what it predicts, what it cannot tell, and what to do about it."""

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.identification.estimate import Estimate
from sidegan.identification.measurements import Samples
from sidegan.identification.model import TorqueModel, states_within
from sidegan.identification.next_runs import most_informative
from sidegan.identification.score import Score, score, score_of_sums
from sidegan.identification.sums import solve
from sidegan.identification.verdict import Trust

_LEAST = 1e-6  # information on each term beside the samples'
_EFFECT = 0.1  # a parameter is weak when one deviation of it makes more than this share of a joint's torque
_STATES = 400
_PACE = 0.5  # of the velocity limits, and 2.5 rad/s²: how fast the arm moves where the model is to hold


def trust(
    model: TorqueModel,
    estimate: Estimate,
    validation: Samples | None = None,
    folds: Score | None = None,
    grams: Tensor | None = None,
    samples_each: int = 1000,
    count: int = 5,
) -> Trust:
    """Whether an estimate of a model can be trusted, and why.

    Args:
        model: what was identified.
        estimate: its parameters.
        validation: recordings that were held out; a list, as they are read twice.
        folds: cross-validation, where it was done.
        grams: information of trajectories that could be run next, from ``grams_of``, (N, P, P).
        samples_each: number of samples that running one of them gives.
        count: how many to recommend.

    Raises:
        ShapeError: when the estimate is of another model or a joint's validation torque is constant.
    """
    if estimate.names != tuple(model.names):
        raise ShapeError("the estimate has other parameters than the model")
    per_unit, torque_deviation = _effects(model, estimate)
    effect = per_unit * estimate.deviation
    weak = [i for i in effect.argsort(descending=True).tolist() if effect[i] > _EFFECT]
    candidates = estimate.parameters, _nominal_fit(model, estimate)
    train, nominal = (score_of_sums(estimate.sums, x) for x in candidates)
    validated = None
    if validation is not None:
        validated, nominal = (score(model, x, validation) for x in candidates)
    runs = None
    if grams is not None:
        targets = torch.where(effect > _EFFECT, per_unit, 0.0) if weak else per_unit
        runs = most_informative(estimate, grams, targets, samples_each, count)
    return Trust(
        arm=model.arm,
        estimate=estimate,
        train=train,
        validation=validated,
        nominal_score=nominal,
        folds=folds,
        effect=effect,
        torque_deviation=torque_deviation,
        weak=tuple(estimate.names[i] for i in weak),
        next_runs=runs,
    )


def _effects(model: TorqueModel, estimate: Estimate) -> tuple[Tensor, Tensor]:
    """Largest share of a joint's usual torque per unit of each parameter, (P,), and of its deviation, (J,).

    Usual is the root mean square over random states within the limits, at half the arm's pace.
    """
    q, dq, ddq = states_within(model.arm, _STATES, seed=1)
    y = model.regressor(q, _PACE * dq, _PACE * ddq)
    usual = (y @ estimate.parameters).square().mean(0).sqrt().clamp_min(torch.finfo(torch.float64).tiny)
    share = y.square().mean(0).sqrt() / usual[:, None]
    variance = torch.einsum("sjp,pq,sjq->j", y, estimate.covariance, y).clamp_min(0) / _STATES
    return share.amax(0), variance.sqrt() / usual


def _nominal_fit(model: TorqueModel, estimate: Estimate) -> Tensor:
    """The description's link parameters with everything else fitted, (P,)."""
    r, nominal = model.rigid, model.nominal.clone()
    information, moment = estimate.information, estimate.moment
    rest = moment[r:] - information[r:, :r] @ nominal[:r]
    if len(rest):
        nominal[r:], _ = solve(information[r:, r:], rest, _LEAST)
    return nominal
