"""Quality of an identified model: its errors, uncertain parameters, and comparison with the description."""

import numpy as np

from sidegan.base.arrays import Array
from sidegan.identification.estimate import Estimate
from sidegan.identification.fit import LEAST, spread_of
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.score import Score, score
from sidegan.identification.sums import solve
from sidegan.identification.verdict import Quality

_EFFECT = 0.1  # share of a joint's torque that one standard deviation of a weak parameter exceeds


def quality(
    model: TorqueModel,
    estimate: Estimate,
    samples: list[Measurements],
    *,
    train: Score,
    validation: Score | None,
    folds: Score | None,
    noise: Array,
) -> Quality:
    """Quality of an estimate, from which its verdict follows.

    ``samples`` are those of the validation, or else of the training; the description's links are tested on
    them. The other arguments are as in ``Quality``.
    """
    per_unit, torque_deviation, usual = _effects(model, estimate)
    effect = per_unit * estimate.deviation
    weak = [i for i in (-effect).argsort().tolist() if effect[i] > _EFFECT]
    return Quality(
        arm=model.arm,
        estimate=estimate,
        train=train,
        validation=validation,
        nominal_score=score(model, _nominal_fit(model, estimate), samples),
        folds=folds,
        torque_deviation=torque_deviation,
        usual=usual,
        weak=tuple(estimate.names[i] for i in weak),
        noise=noise,
    )


def _effects(model: TorqueModel, estimate: Estimate) -> tuple[Array, Array, Array]:
    """Effect of a unit of each parameter, (P,), deviation of torques, (J,), and usual torques, (J,).

    Both effects are shares of the usual torque: the root mean square over ``TorqueModel.usual_states``.
    """
    y = model.regressor(*model.usual_states())
    usual = np.maximum(np.sqrt(np.square(y @ estimate.parameters).mean(0)), np.finfo(float).tiny)
    share = np.sqrt(np.square(y).mean(0)) / usual[:, None]
    return share.max(0), np.sqrt(spread_of(y, estimate.covariance) / len(y)) / usual, usual


def _nominal_fit(model: TorqueModel, estimate: Estimate) -> Array:
    """The description's link parameters with all other terms fitted, (P,)."""
    r = model.rigid
    nominal = model.nominal.copy()
    information, moment = estimate.sums.weighted(estimate.weights)
    rest = moment[r:] - information[r:, :r] @ nominal[:r]
    if len(rest):
        nominal[r:], _ = solve(information[r:, r:], rest, LEAST)
    return nominal
