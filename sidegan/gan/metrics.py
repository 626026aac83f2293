"""How good a generator is, measured with the true physics and not with the surrogates."""

import torch
from torch import Tensor

from sidegan.design.excitation import diversity, excite, mean_distance
from sidegan.design.fidelity import beyond, proportions
from sidegan.design.prediction import (
    TOGETHER,
    Prediction,
    random_motions,
    sampled,
    wanted_torques,
)
from sidegan.design.problem import Problem
from sidegan.gan.reward import noises
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

_POOL, _DRAWS = 200, 100  # valid trajectories from which sets are drawn, and how many of these


def measure(
    constraints: Constraints, trajectory: Trajectory, c: Tensor, seeds: Tensor | None = None
) -> dict[str, float]:
    """Validity, fitness, diversity and worth of generated coefficients (N, J, H, 2), beside seeds.

    They only count together: a generator that hardly moves is valid, one with a few distant modes has a large
    mean distance, one that adds the same motion to all of them has a small condition number. ``condition`` is
    the median over all samples, ``condition_mean`` their mean as in the paper's figure 3, ``condition_valid``
    the median over the valid ones (not a number when there are none), as are those of ``expected_errors``.
    """
    valid = check(constraints, trajectory, c).valid
    excitation = excite(constraints.body, trajectory, c)
    condition = excitation.eigenvalue_fitness
    return {
        "success": float(valid.double().mean()),
        "condition": float(condition.median()),
        "condition_mean": float(condition.mean()),
        "condition_valid": float(condition[valid].median()),
        "diagonal_ratio": float(excitation.diagonal_fitness.median()),
        "distance_valid": mean_distance(c[valid]) if int(valid.sum()) > 1 else float("nan"),
        **diversity(c, excitation),
        **(proportions(c) if len(c) > 1 else {}),
        **({} if seeds is None else {"beyond": beyond(c, seeds)}),
        **expected_errors(constraints, trajectory, c[valid]),
    }


def expected_errors(constraints: Constraints, trajectory: Trajectory, c: Tensor) -> dict[str, float]:
    """Expected nMSE of 35 of some valid trajectories (N, J, H, 2), drawn at random, on random motions.

    Under the paper's noise and equal weights, and under a constant noise by which joints are weighted; mean
    over joints and draws, and geometric mean. Infinite where there are no 35.
    """
    body, motions = constraints.body, random_motions(Problem(constraints, trajectory))
    wanted = wanted_torques(body, trajectory, motions, sampled(trajectory))
    errors: dict[str, float] = {}
    for name, noise in zip(("error", "error_constant"), noises(body).values()):
        predicting, nmse = Prediction.at_rate(body, trajectory, wanted, noise), wanted.new_tensor(torch.inf)
        if len(c) >= TOGETHER:
            nmse = predicting.of_draws(c[:_POOL], draws=_DRAWS)
        errors |= {name: float(nmse.mean()), f"{name}_geometric": float(nmse.log().mean().exp())}
    return errors
