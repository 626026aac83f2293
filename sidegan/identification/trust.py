"""Whether to trust an identified model: what it predicts, what it cannot tell, and what to do about it."""

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.identification.estimate import Estimate
from sidegan.identification.measurements import Samples
from sidegan.identification.model import TorqueModel
from sidegan.identification.score import Score, score, score_of_sums
from sidegan.identification.sums import solve
from sidegan.identification.verdict import NextRuns, Trust
from sidegan.motion.trajectory import Trajectory

_LEAST = 1e-6  # information on each term beside the samples'
_EFFECT = 0.1  # a parameter is weak when one deviation of it makes more than this share of a joint's torque
_STATES_AT_ONCE = 4096
_GRAMS_AT_ONCE = 256


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

    Recordings that were held out are a list, as they are read twice. With the information ``grams`` of
    trajectories that could be run next, (N, P, P) of ``grams_of``, some are recommended, of which each gives
    so many samples.

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
    y = model.usual_rows(seed=1)
    usual = (y @ estimate.parameters).square().mean(0).sqrt().clamp_min(torch.finfo(torch.float64).tiny)
    share = y.square().mean(0).sqrt() / usual[:, None]
    variance = torch.einsum("sjp,pq,sjq->j", y, estimate.covariance, y).clamp_min(0) / len(y)
    return share.amax(0), variance.sqrt() / usual


def _nominal_fit(model: TorqueModel, estimate: Estimate) -> Tensor:
    """The description's link parameters with everything else fitted, (P,)."""
    r, nominal = model.rigid, model.nominal.clone()
    information, moment = estimate.information, estimate.moment
    rest = moment[r:] - information[r:, :r] @ nominal[:r]
    if len(rest):
        nominal[r:], _ = solve(information[r:, r:], rest, _LEAST)
    return nominal


def grams_of(
    model: TorqueModel, estimate: Estimate, trajectory: Trajectory, c: Tensor, samples: int = 80
) -> Tensor:
    """Information per sample on a model's parameters that trajectories give, (N, P, P).

    The trajectories have coefficients [rad/s], (N, J, H, 2), and are looked at at so many time points; the
    estimate's errors say how much each joint's torque tells, and how many samples count as one.
    """
    trajectory.check(c)
    times, weights = trajectory.grid(samples), certainty(estimate)
    grams = []
    for part in c.split(max(1, _STATES_AT_ONCE // samples)):
        states = [x.flatten(0, 1) for x in trajectory.roll_out(part, times)[1:]]
        y = (model.regressor(*states) * weights[:, None]).reshape(len(part), -1, model.count)
        grams.append(y.mT @ y / samples)
    return torch.cat(grams)


def certainty(estimate: Estimate) -> Tensor:
    """One over the deviation that a sample's error would have if samples were independent, (J,)."""
    return 1 / (estimate.residual_rms * estimate.inflation.sqrt())


def most_informative(
    estimate: Estimate, grams: Tensor, effects: Tensor, samples: int, count: int
) -> NextRuns:
    """The greedy pick of trajectories by what is left of the parameters' variances after running them.

    Args:
        estimate: what is known so far.
        grams: of the candidates, from ``grams_of``, (N, P, P).
        effects: how much each parameter matters per unit, (P,); zero for those that are certain enough.
        samples: number that running one trajectory gives.
        count: of picks; a trajectory may be picked again, as running it again helps too.
    """
    scale = estimate.deviation.clamp_min(torch.finfo(torch.float64).tiny)
    outer = scale[:, None] * scale
    information = torch.linalg.pinv(estimate.covariance / outer, hermitian=True)
    targets = torch.diag(effects * scale)[:, effects > 0]
    now, indices, shares = _variance(information[None], targets)[0], [], []
    for _ in range(count):
        parts = grams.split(_GRAMS_AT_ONCE)
        left = [_variance(information + samples * part * outer, targets) for part in parts]
        variances = torch.cat(left)
        best = int(variances.argmin())
        information = information + samples * grams[best] * outer
        indices.append(best)
        shares.append(float(variances[best] / now))
    return NextRuns(torch.tensor(indices), torch.tensor(shares, dtype=torch.float64))


def _variance(information: Tensor, targets: Tensor) -> Tensor:
    """Sum over targets t of tᵀ information⁻¹ t, (N,)."""
    factor = torch.linalg.cholesky(information)
    half = torch.linalg.solve_triangular(factor, targets.expand(len(information), -1, -1), upper=False)
    return half.square().sum((1, 2))
