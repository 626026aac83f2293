"""What is drawn until enough are valid, and what is measured about trajectories."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from sidegan.design.excitation import condition_of, information_of, measure_excitation
from sidegan.design.fidelity import diversity
from sidegan.errors import InfeasibleError
from sidegan.library.draw import Expansion, draw_valid
from sidegan.library.measure import RATE, library_of, likeness, summary
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane, check
from tests.refusals import refused


@pytest.fixture(scope="module")
def pool():
    """Constraints, a family, and more random trajectories than are measured at once."""
    constraints, family = Constraints(load_robot("planar2"), [Plane((0, 0, 1), 0.1)]), Trajectory(2, 3, 8.0)
    c = np.random.default_rng(0).standard_normal((260, *family.shape))
    return constraints, family, 0.5 * c


def test_a_measured_library_holds_margins_and_excitation(pool):
    constraints, family, c = pool
    library = library_of(*pool, "random")
    for size in (1e74, 1e76, 1e150, 1e300):  # whose powers overflow
        absurd = library_of(constraints, family, size * c[:1], "random")
        assert not absurd.valid.any() and np.isinf(absurd.fitness).all()
    verdict = check(*pool)
    excitation = measure_excitation(constraints.body, family, c, round(RATE * family.period))
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


@pytest.mark.parametrize(("harmonics", "period"), [(6, 1.0), (6, 0.03), (40, 16.0)])
def test_excitation_is_accurate_for_short_periods_and_many_harmonics(pool, harmonics, period):
    constraints, family = pool[0], Trajectory(2, harmonics, period)
    c = 0.1 * np.random.default_rng(0).standard_normal((2, *family.shape))
    exact = measure_excitation(constraints.body, family, c, 100 * harmonics).eigenvalue_fitness
    np.testing.assert_allclose(library_of(constraints, family, c, "random").fitness, exact, rtol=1e-2)
    found = measure_excitation(constraints.body, family, c).eigenvalue_fitness
    np.testing.assert_allclose(found, exact, rtol=1e-2)
    information = information_of(constraints.body, family, c)
    np.testing.assert_allclose([condition_of(x) for x in information], exact, rtol=1e-2)


def test_likeness_compares_equally_many_and_reports_unexciting_sets(pool):
    constraints, family, c = pool
    seeds, library = (library_of(constraints, family, x, "any") for x in (c[:60], c[60:]))
    found = likeness(library, seeds)
    assert found == likeness(library.take(range(60)), seeds)
    assert found["coverage"] > 0.8 and found["coverage_diagonal"] > 0.8 and 0.3 < found["told_apart"] < 0.7
    assert likeness(seeds, seeds)["nearest_seed"] == 0
    still = likeness(library_of(constraints, family, 0 * c[:60], "any"), seeds)
    assert still["norm"] == still["cosine"] == still["coverage_diagonal"] == 0 and still["told_apart"] > 0.9


class Source:
    """Trajectories 0, 1, 2, …, of which every so many-th is valid."""

    def __init__(self, every):
        self.every, self.sizes = every, []

    def sample(self, count):
        start = sum(self.sizes)
        self.sizes.append(count)
        return np.arange(start, start + count)[:, None, None, None] * np.ones(2)

    def check(self, c):
        valid = c[:, 0, 0, 0] % self.every == self.every - 1
        return SimpleNamespace(valid=valid, faults=lambda: Counter({"torque of wrist": int((~valid).sum())}))

    def draw(self, count, batch, draws, least=1, origin="drawn from eigen", report=None):
        settings = Expansion(count=count, batch=batch, draws=draws, least=least)
        return draw_valid(self.sample, self.check, settings, origin, report)


def test_the_first_valid_ones_are_kept_in_order(caplog):
    source = Source(3)
    draws = source.draw(4, 5, 100, least=4)
    assert draws.coefficients[:, 0, 0, 0].tolist() == [2, 5, 8, 11]
    assert (draws.drawn, draws.valid, source.sizes) == (15, 5, [5, 5, 5])
    assert not caplog.text


def test_draws_are_limited_and_the_valid_share_reported(caplog):
    source, steps = Source(3), []
    draws = source.draw(40, 6, 20, report=lambda *step: steps.append(step))
    assert source.sizes == [6, 6, 6, 2] and draws.drawn == 20
    assert len(draws.coefficients) == draws.valid == 6
    assert steps == [(12, 40), (24, 40), (36, 40), (40, 40)]
    assert all(word in caplog.text for word in ("6", "20", "40", "drawn from eigen"))


@pytest.mark.parametrize(
    ("every", "batch", "draws", "least", "about"),
    [
        (1000, 20, 60, 1, "0 of 60, 20 violate torque of wrist"),
        (20, 20, 60, 4, "3 of 60, 4 or more, of 20 of them, 19 violate torque of wrist"),
        (3, 5, 6, 4, "2 of 6, of 5 of them, 4 violate torque of wrist"),  # the last batch is valid
        (1, 3, 3, 4, "3 of 3, 4 or more"),
    ],
)
def test_too_few_are_refused(every, batch, draws, least, about):
    with refused(InfeasibleError, "polished", *about.split(", ")):
        Source(every).draw(4, batch, draws, least, "polished")
