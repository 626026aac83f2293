"""How good a generator is, measured with the true physics and not with the surrogates."""

import numpy as np

from sidegan.base.arrays import Array
from sidegan.design.excitation import excite
from sidegan.design.fidelity import beyond, diversity, mean_distance, proportions
from sidegan.design.prediction import (
    TOGETHER,
    Prediction,
    TorqueNoise,
    random_motions,
    sampled,
    wanted_torques,
)
from sidegan.design.problem import Problem
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

_LEVEL, _SHARE = 0.1, 0.01  # noise, of the torque as the paper has it, and of each joint's torque limit
_POOL, _DRAWS = 200, 100  # valid trajectories from which sets are drawn, and how many of these


def noises(body: RigidBody) -> dict[str, TorqueNoise]:
    """Noise on torques under which a model is identified, by the names in ``settings.Reward``."""
    return {
        "proportional": TorqueNoise.proportional(_LEVEL, np.ones(body.joints)),
        "constant": TorqueNoise.constant(body, _SHARE),
    }


def measure(
    constraints: Constraints, trajectory: Trajectory, c: Array, seeds: Array | None = None
) -> dict[str, float]:
    """Validity, fitness, diversity and worth of generated coefficients (N, J, H, 2), beside seeds.

    They only count together: a generator that hardly moves is valid, one with a few distant modes has a large
    mean distance, one that adds the same motion to all of them has a small condition number. ``condition``
    is the median over all samples and ``condition_mean`` their mean, as in figure 3 of the paper;
    ``condition_valid`` is the median over the valid ones (not a number when there are none), and those alone
    count for the errors of ``expected_errors``.
    """
    valid = check(constraints, trajectory, c).valid
    excitation = excite(constraints.body, trajectory, c)
    condition = excitation.eigenvalue_fitness
    return {
        "success": float(valid.mean()),
        "condition": float(np.median(condition)),
        "condition_mean": float(condition.mean()),
        "condition_valid": float(np.median(condition[valid])) if valid.any() else float("nan"),
        "diagonal_ratio": float(np.median(excitation.diagonal_fitness)),
        "distance_valid": mean_distance(c[valid]) if valid.sum() > 1 else float("nan"),
        **diversity(c, excitation.diagonal),
        **(proportions(c) if len(c) > 1 else {}),
        **({} if seeds is None else {"beyond": beyond(c, seeds)}),
        **expected_errors(constraints, trajectory, c[valid]),
    }


def expected_errors(constraints: Constraints, trajectory: Trajectory, c: Array) -> dict[str, float]:
    """Expected nMSE of 35 of some valid trajectories (N, J, H, 2), drawn at random, on random motions.

    Under the paper's noise and equal weights, and under a constant noise by which joints are weighted; mean
    over joints and draws, and geometric mean. Infinite where there are no 35.
    """
    body, motions = constraints.body, random_motions(Problem(constraints, trajectory))
    wanted = wanted_torques(body, trajectory, motions, sampled(trajectory))
    errors: dict[str, float] = {}
    for name, noise in zip(("error", "error_constant"), noises(body).values()):
        predicting, nmse = Prediction.at_rate(body, trajectory, wanted, noise), np.array(np.inf)
        if len(c) >= TOGETHER:
            nmse = predicting.of_draws(c[:_POOL], draws=_DRAWS)
        errors |= {name: float(nmse.mean()), f"{name}_geometric": float(np.exp(np.log(nmse).mean()))}
    return errors
