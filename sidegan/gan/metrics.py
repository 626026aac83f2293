"""Quality of a generator, measured with exact physics instead of the surrogates."""

import numpy as np

from sidegan.base.arrays import Array, geometric_mean
from sidegan.design.excitation import measure_excitation
from sidegan.design.fidelity import beyond, diversity, mean_distance, proportions
from sidegan.design.prediction import (
    TOGETHER,
    Prediction,
    TorqueNoise,
    random_motions,
    sample_times,
    wanted_torques,
)
from sidegan.design.problem import Problem
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

_LEVEL, _SHARE = 0.1, 0.01  # noise relative to the torque, as in the paper, and to each joint's torque limit
_POOL, _DRAWS = 200, 100  # valid trajectories to draw sets from, and number of sets


def noises(body: RigidBody) -> dict[str, TorqueNoise]:
    """Torque noise in the identification of a model, by the names in ``settings.Reward``."""
    return {
        "proportional": TorqueNoise.proportional(_LEVEL, np.ones(body.joints)),
        "constant": TorqueNoise.constant(body, _SHARE),
    }


def measure_samples(
    constraints: Constraints, trajectory: Trajectory, c: Array, seeds: Array | None = None
) -> dict[str, float]:
    """Validity, fitness, diversity and prediction errors of generated coefficients, (N, J, H, 2).

    None of them suffices alone: a generator that hardly moves is valid, one with a few distant modes has a
    large mean distance, one with a common offset a small condition number. ``condition`` is the median over
    all samples and ``condition_mean`` their mean, as in figure 3 of the paper; ``condition_valid`` is the
    median over the valid ones (NaN if there are none). Errors are those of sets of valid ones.
    """
    valid = check(constraints, trajectory, c).valid
    excitation = measure_excitation(constraints.body, trajectory, c)
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
        **random_set_errors(constraints, trajectory, c[valid]),
    }


def random_set_errors(constraints: Constraints, trajectory: Trajectory, c: Array) -> dict[str, float]:
    """Expected nMSE on random motions after identification from random sets of 35 of N trajectories.

    With the paper's noise and equal weights, and with constant noise and joints weighted by it; arithmetic
    and geometric mean over joints and draws. Infinite for fewer than 35 trajectories, (N, J, H, 2).
    """
    body = constraints.body
    motions = random_motions(Problem(constraints, trajectory))
    wanted = wanted_torques(body, trajectory, motions, sample_times(trajectory))
    errors: dict[str, float] = {}
    for name, noise in zip(("error", "error_constant"), noises(body).values()):
        predicting = Prediction.at_rate(body, trajectory, wanted, noise)
        nmse = np.array(np.inf)
        if len(c) >= TOGETHER:
            nmse = predicting.of_draws(c[:_POOL], draws=_DRAWS)
        errors |= {name: float(nmse.mean()), f"{name}_geometric": geometric_mean(nmse)}
    return errors
