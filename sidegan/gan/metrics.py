"""How good a generator is, measured with the true physics and not with the surrogates."""

from collections.abc import Mapping, Sequence

from torch import Tensor

from sidegan.design.excitation import diversity, excite, mean_distance
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

_TINY = 1e-12  # a valid share that is not none


def measure(constraints: Constraints, trajectory: Trajectory, c: Tensor) -> dict[str, float]:
    """Validity, fitness and diversity of generated coefficients (N, J, H, 2).

    The three only count together: a generator that hardly moves is valid, one with a few distant modes
    has a large mean distance. ``condition`` is over all samples, ``condition_valid`` over the valid ones
    (not a number when there are none).
    """
    valid = check(constraints, trajectory, c).valid
    excitation = excite(constraints.body, trajectory, c)
    condition = excitation.eigenvalue_fitness
    return {
        "success": float(valid.double().mean()),
        "condition": float(condition.median()),
        "condition_valid": float(condition[valid].median()),
        "diagonal_ratio": float(excitation.diagonal_fitness.median()),
        "distance_valid": mean_distance(c[valid]) if int(valid.sum()) > 1 else float("nan"),
        **diversity(c, excitation),
    }


def kept_epoch(history: Sequence[Mapping[str, float]], least_valid: float | None) -> int:
    """Index of the epoch whose generator is kept.

    The validity of a surrogate's trajectories is traded for excitation epoch by epoch, more or less of it in
    each training. Where that trade stops is set here: of the epochs whose valid share is at least
    ``least_valid`` of the best one's, the one with the smallest condition number of its valid trajectories.
    The last one where that is None, or where no epoch made anything valid.
    """
    best = max(row["success"] for row in history)
    if least_valid is None or best == 0:
        return len(history) - 1
    reliable = [i for i, row in enumerate(history) if row["success"] >= max(least_valid * best, _TINY)]
    return min(reliable, key=lambda i: history[i]["condition_valid"])
