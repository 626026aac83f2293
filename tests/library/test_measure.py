"""What is measured about trajectories, beside the functions that measure it."""

import numpy as np
import pytest

from sidegan.design.excitation import excite
from sidegan.design.fidelity import diversity
from sidegan.library.measure import RATE, likeness, measured, summary
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane, check


@pytest.fixture(scope="module")
def pool():
    """Constraints, a family, and more random trajectories than are measured at once."""
    constraints, family = Constraints(load_robot("planar2"), [Plane((0, 0, 1), 0.1)]), Trajectory(2, 3, 8.0)
    c = np.random.default_rng(0).standard_normal((260, *family.shape))
    return constraints, family, 0.5 * c


def test_a_measured_library_holds_margins_and_excitation(pool):
    constraints, family, c = pool
    library = measured(*pool, "random")
    for size in (1e74, 1e76, 1e150, 1e300):  # whose powers overflow
        absurd = measured(constraints, family, size * c[:1], "random")
        assert not absurd.valid.any() and np.isinf(absurd.fitness).all()
    verdict = check(*pool)
    excitation = excite(constraints.body, family, c, round(RATE * family.period))
    assert library.valid.tolist() == verdict.valid.tolist() and 0 < int(library.valid.sum()) < len(c)
    for name, margin in verdict.margins.items():
        np.testing.assert_allclose(library.margins[name], margin)
    np.testing.assert_allclose(library.fitness, excitation.eigenvalue_fitness)
    np.testing.assert_allclose(library.spectrum, excitation.spectrum)
    np.testing.assert_allclose(library.diagonal, excitation.diagonal)
    assert library.source == ["random"] * len(c) and library.digest == constraints.arm.digest
    assert (library.period, library.home) == (8.0, (0.0, 0.0))
    facts = summary(library)
    assert facts["count"] == len(c) and 0 < facts["valid"] < 1
    assert facts["condition"] == pytest.approx(np.median(excitation.eigenvalue_fitness))
    assert diversity(c, excitation.diagonal).items() <= facts.items()


def test_likeness_compares_equally_many_and_reports_unexciting_sets(pool):
    constraints, family, c = pool
    seeds, library = (measured(constraints, family, x, "any") for x in (c[:60], c[60:]))
    found = likeness(library, seeds)
    assert found == likeness(library.take(range(60)), seeds)
    assert found["coverage"] > 0.8 and found["coverage_diagonal"] > 0.8 and 0.3 < found["told_apart"] < 0.7
    assert likeness(seeds, seeds)["nearest_seed"] == 0
    still = likeness(measured(constraints, family, 0 * c[:60], "any"), seeds)
    assert still["norm"] == still["cosine"] == still["coverage_diagonal"] == 0 and still["told_apart"] > 0.9
