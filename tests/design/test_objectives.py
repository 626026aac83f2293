"""Terms of exact objectives: what they are of, and what counts of a batch."""

import math

import pytest

from sidegan.design.excitation import excite
from sidegan.design.objectives import Term


@pytest.mark.parametrize("objective", ["log_condition", "diagonal_ratio", "d_optimal", "a_optimal"])
@pytest.mark.parametrize("together, whole", [(1, 8), (3, 6), (5, 5)])
def test_a_set_that_a_batch_does_not_fill_is_left_out(planar_problem, random, objective, together, whole):
    term, c = Term(objective, together=together), planar_problem.start(8, random)
    value = term(planar_problem, c)
    assert float(value) == pytest.approx(float(term(planar_problem, c[:whole])), rel=1e-12)
    parts = [float(term(planar_problem, part)) for part in c[:whole].split(together)]
    assert float(value) == pytest.approx(sum(parts) / len(parts), rel=1e-9)


def test_one_ratio_is_of_the_eigenvalues_and_the_other_of_the_diagonal(planar_problem, random):
    """Smooth extremes are outside of the true ones, by at most log(number) / 6 each."""
    c = planar_problem.start(6, random)
    exact = excite(planar_problem.body, planar_problem.trajectory, c, planar_problem.samples)
    ratios = {"log_condition": exact.eigenvalue_fitness, "diagonal_ratio": exact.diagonal_fitness}
    means = {name: float(ratio.log().mean()) for name, ratio in ratios.items()}
    assert means["log_condition"] > means["diagonal_ratio"] + math.log(6) / 6
    for name, mean in means.items():
        assert -1e-9 <= float(Term(name)(planar_problem, c)) - mean <= math.log(6) / 6
