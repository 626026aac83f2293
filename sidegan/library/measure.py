"""Measurement of trajectories: a library with margins and excitation, and its summary."""

import torch
from torch import Tensor

from sidegan.design.excitation import Excitation, diversity, excite
from sidegan.library.collection import Library
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

RATE = 12.5  # [Hz] at which stored excitation is taken: finer than any optimiser's samples
_AT_ONCE = 250  # trajectories


def measured(constraints: Constraints, trajectory: Trajectory, c: Tensor, source: str) -> Library:
    """A library of coefficients (N, J, H, 2) with everything measured about them."""
    parts = []
    for batch in c.detach().to("cpu", torch.float64).split(_AT_ONCE):
        validity = check(constraints, trajectory, batch)
        excitation = excite(constraints.body, trajectory, batch, round(RATE * trajectory.period))
        part = Library(
            coefficients=batch,
            valid=validity.valid,
            margins=validity.margins,
            fitness=excitation.eigenvalue_fitness,
            diagonal_fitness=excitation.diagonal_fitness,
            spectrum=excitation.spectrum,
            diagonal=excitation.diagonal,
            source=[source] * len(batch),
            robot=constraints.arm.name,
            digest=constraints.arm.digest,
            period=trajectory.period,
            home=tuple(trajectory.home or ()),
        )
        parts.append(part)
    return parts[0].merge(*parts[1:])


def summary(library: Library) -> dict[str, float]:
    """Validity, fitness and diversity of a library."""
    return {
        "count": len(library),
        "valid": float(library.valid.double().mean()),
        "condition": float(library.fitness.median()),
        "diagonal_ratio": float(library.diagonal_fitness.median()),
        **diversity(library.coefficients, Excitation(library.spectrum, library.diagonal)),
    }
