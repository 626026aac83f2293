"""Whether to trust an identified model: what it predicts, what it cannot tell, and what to do about it."""

from dataclasses import dataclass, field

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.identification.estimate import Estimate
from sidegan.identification.measurements import Samples
from sidegan.identification.model import TorqueModel, states_within
from sidegan.identification.next_runs import NextRuns, most_informative
from sidegan.identification.score import Folds, Score, score, score_of_sums
from sidegan.identification.sums import solve
from sidegan.identification.verdict import Evidence, Thresholds, judge

_LEAST = 1e-6  # information on each term beside the samples'
_STATES = 400
_PACE = 0.5  # of the velocity limits, and 2.5 rad/s²: how fast the arm moves where the model is to hold


@dataclass(frozen=True, eq=False)
class Trust:
    """What is known about the quality of an identified model.

    Attributes:
        names: of the parameters, (P,).
        formulas: what each is made of, (P,).
        parameters: identified, (P,).
        deviation: standard deviation of each, (P,).
        relative_deviation: the same over the parameter's size, (P,).
        nominal: parameters of the arm's description, without friction, (P,).
        effect: largest share of a joint's usual torque that one deviation of the parameter makes, (P,).
        torque_deviation: standard deviation of the predicted torque over the joint's usual torque, anywhere
            within the limits, (J,).
        condition: of the weighted, column-scaled regressor.
        whiteness: independent residuals per sample, (J,); one for white residuals.
        correlation: of neighbouring residuals, (J,).
        train: errors on what was identified from.
        validation: errors on what was held out; None when nothing was.
        nominal_score: errors of the description's link parameters with fitted friction, on the same samples
            as ``validation``, or else ``train``.
        folds: each recording predicted from the others; None when not asked for.
        weak: parameters whose errors matter, the worst first.
        verdict: ``"good"``, ``"usable"`` or ``"not trustworthy"``.
        reasons: why, with the joints and parameters by name.
        next_runs: what to run next; None without candidates.
    """

    names: tuple[str, ...]
    formulas: tuple[str, ...]
    parameters: Tensor
    deviation: Tensor
    relative_deviation: Tensor
    nominal: Tensor
    effect: Tensor
    torque_deviation: Tensor
    condition: float
    whiteness: Tensor
    correlation: Tensor
    train: Score
    validation: Score | None
    nominal_score: Score
    folds: Folds | None
    weak: tuple[str, ...]
    verdict: str
    reasons: list[str] = field(default_factory=list)
    next_runs: NextRuns | None = None


def trust(
    model: TorqueModel,
    estimate: Estimate,
    validation: Samples | None = None,
    folds: Folds | None = None,
    grams: Tensor | None = None,
    samples_each: int = 1000,
    count: int = 5,
    limits: Thresholds | None = None,
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
        limits: what counts as good and as usable.

    Raises:
        ShapeError: when the estimate is of another model or a joint's validation torque is constant.
        ConfigError: when ``samples_each`` or ``count`` is not positive.
    """
    if estimate.names != tuple(model.names):
        raise ShapeError("the estimate has other parameters than the model")
    limits = limits or Thresholds()
    per_unit, torque_deviation = _effects(model, estimate)
    effect = per_unit * estimate.deviation
    order = [i for i in effect.argsort(descending=True).tolist() if effect[i] > limits.effect]
    train = score_of_sums(estimate.sums, estimate.parameters)
    validated = None if validation is None else score(model, estimate.parameters, validation)
    nominal = _nominal_fit(model, estimate)
    plain = score_of_sums(estimate.sums, nominal) if validation is None else score(model, nominal, validation)
    weak = tuple(estimate.names[i] for i in order)
    evidence = Evidence(model.arm, estimate, train, validated, plain, folds, weak, torque_deviation)
    verdict, reasons = judge(evidence, limits)
    runs = None
    if grams is not None:
        targets = torch.where(effect > limits.effect, per_unit, 0.0) if order else per_unit
        runs = most_informative(estimate, grams, targets, samples_each, count)
    return Trust(
        names=estimate.names,
        formulas=tuple(model.formulas),
        parameters=estimate.parameters,
        deviation=estimate.deviation,
        relative_deviation=estimate.relative_deviation,
        nominal=model.nominal,
        effect=effect,
        torque_deviation=torque_deviation,
        condition=estimate.condition,
        whiteness=1 / estimate.inflation,
        correlation=estimate.correlation,
        train=train,
        validation=validated,
        nominal_score=plain,
        folds=folds,
        weak=weak,
        verdict=verdict,
        reasons=reasons,
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
