"""How good a generator is, measured with the true physics and not with the surrogates."""

from torch import Tensor

from sidegan.design.excitation import diversity, excite, mean_distance
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check


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
