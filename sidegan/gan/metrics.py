"""How good a generator is, measured with the true physics and not with the surrogates."""

import torch
from torch import Tensor

from sidegan.design.excitation import Excitation, effective_rank, excite, mean_distance, nearest_distance
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

NOISE_BATCHES = 10  # the paper averages over ten noise batches


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
        "condition": _median(condition),
        "condition_valid": _median(condition[valid]),
        "diagonal_ratio": _median(excitation.diagonal_fitness),
        **diversity(c, excitation),
    }


def diversity(c: Tensor, excitation: Excitation) -> dict[str, float]:
    """The paper's two mean distances, over batches, and two measures that modes cannot fool."""
    batch = max(2, len(c) // NOISE_BATCHES)
    pairs = [
        (mean_distance(x), mean_distance(y))
        for x, y in zip(c.split(batch), excitation.diagonal.split(batch))
        if len(x) > 1
    ]
    coefficients, diagonal = torch.tensor(pairs, dtype=torch.float64).mean(0).tolist()
    return {
        "distance": coefficients,
        "distance_diagonal": diagonal,
        "nearest": nearest_distance(c),
        "rank": effective_rank(c),
    }


def _median(x: Tensor) -> float:
    return float(x.median()) if len(x) else float("nan")
