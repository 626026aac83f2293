"""Measure trajectories: a library with margins and excitation, its summary, and its likeness to seeds."""

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.design import fidelity
from sidegan.design.excitation import enough_samples, measure_excitation
from sidegan.library.collection import Library, join
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

RATE = 12.5  # least sampling rate of stored excitation [Hz]: finer than the optimisers' at usual periods
_AT_ONCE = 250  # trajectories per batch
_LEAST = 1e-30  # lower bound of diag(YᵀY), which is zero for a column without excitation
_MOST = 5_000  # trajectories of a comparison, whose pairs fit in memory


def library_of(constraints: Constraints, trajectory: Trajectory, c: Array, source: str) -> Library:
    """A library of copies of coefficients (N, J, H, 2), with their margins and excitation."""

    def measured(part: Array) -> Library:
        validity = check(constraints, trajectory, part)
        samples = enough_samples(trajectory, round(RATE * trajectory.period))
        excitation = measure_excitation(constraints.body, trajectory, part, samples)
        return Library(
            coefficients=part,
            valid=validity.valid,
            margins=validity.margins,
            fitness=excitation.eigenvalue_fitness,
            diagonal_fitness=excitation.diagonal_fitness,
            spectrum=excitation.spectrum,
            diagonal=excitation.diagonal,
            source=[source] * len(part),
            robot=constraints.arm.name,
            digest=constraints.arm.digest,
            period=trajectory.period,
            home=tuple(trajectory.home or ()),
        )

    return join(map(measured, split(c, _AT_ONCE)), len(c))


def summary(library: Library) -> dict[str, float]:
    """Validity, fitness and diversity of a library."""
    return {
        "count": len(library),
        "valid": float(library.valid.mean()),
        "condition": float(np.median(library.fitness)),
        "diagonal_ratio": float(np.median(library.diagonal_fitness)),
        **fidelity.diversity(library.coefficients, library.diagonal),
    }


def likeness(library: Library, seeds: Library) -> dict[str, float]:
    """Common offsets of a library, and its similarity to seeds that it does not contain.

    Most measures depend on the number of trajectories: both sets are cut to the size of the smaller, at most
    5,000.
    """
    count = min(len(library), len(seeds), _MOST)
    c, other = library.coefficients[:count], seeds.coefficients[:count]
    diagonals = [np.log(np.maximum(part.diagonal[:count], _LEAST)) for part in (library, seeds)]
    density, coverage = fidelity.density_and_coverage(c, other)
    density_diagonal, coverage_diagonal = fidelity.density_and_coverage(*diagonals)
    return {
        **fidelity.proportions(c),
        "nearest_other": fidelity.nearest_distance(c),
        "nearest_seed": fidelity.distance_to(c, other),
        "beyond": fidelity.beyond(c, other),
        "density": density,
        "coverage": coverage,
        "density_diagonal": density_diagonal,
        "coverage_diagonal": coverage_diagonal,
        "told_apart": fidelity.classifier_accuracy(c, other),
    }
