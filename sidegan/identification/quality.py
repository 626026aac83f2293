"""Quality of an identified model: its errors, its uncertain parameters, and the description beside it."""

import numpy as np

from sidegan.base.arrays import Array
from sidegan.identification.accuracy import spread_of
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
    weak = [i for i in (-effect).argsort().tolist() if effect[i] > _EFFECT]
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


def _effects(model: TorqueModel, estimate: Estimate) -> tuple[Array, Array, Array]:
    """Share of usual torques per unit of each parameter, (P,), of their deviation, (J,), and these, (J,).

    Usual is the root mean square over random states within the limits, at half the arm's pace.
    """
    y = model.regressor(*model.usual_states())
    usual = np.maximum(np.sqrt(np.square(y @ estimate.parameters).mean(0)), np.finfo(float).tiny)
    share = np.sqrt(np.square(y).mean(0)) / usual[:, None]
    return share.max(0), np.sqrt(spread_of(y, estimate.covariance) / len(y)) / usual, usual


def _nominal_fit(model: TorqueModel, estimate: Estimate) -> Array:
    """The description's link parameters with everything else fitted, (P,)."""
    r, nominal = model.rigid, model.nominal.copy()
    information, moment = estimate.sums.weighted(estimate.weights)
    rest = moment[r:] - information[r:, :r] @ nominal[:r]
    if len(rest):
        nominal[r:], _ = solve(information[r:, r:], rest, _LEAST)
    return nominal
