"""Which trajectories to run next: those that make the weak parameters certain soonest."""

from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.identification.estimate import Estimate
from sidegan.identification.model import TorqueModel
from sidegan.motion.trajectory import Trajectory

_STATES_AT_ONCE = 4096
_GRAMS_AT_ONCE = 256


class NextRuns(NamedTuple):
    """Trajectories to run, the most useful one first."""

    indices: Tensor  # among the candidates, (count,)
    # of the weak parameters, summed in units of their effect, over what it is now, after each run, (count,)
    variance: Tensor


def grams_of(
    model: TorqueModel, estimate: Estimate, trajectory: Trajectory, c: Tensor, samples: int = 80
) -> Tensor:
    """Information per sample on a model's parameters that trajectories give, (N, P, P).

    Args:
        model: what was identified.
        estimate: its errors say how much each joint's torque tells, and how many samples count as one.
        trajectory: the family of trajectories.
        c: coefficients [rad/s], (N, J, H, 2).
        samples: time points per trajectory.

    Raises:
        ShapeError: when the coefficients do not fit or are not finite.
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
        samples: number of samples that running one trajectory gives.
        count: how many to choose; one may be chosen more than once, as running it again helps too.
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
