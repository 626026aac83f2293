"""Terms of exact objectives: what counts of a batch."""

import pytest

from sidegan.design.objectives import Term


@pytest.mark.parametrize("objective", ["log_condition", "diagonal_ratio", "d_optimal", "a_optimal"])
@pytest.mark.parametrize("together, whole", [(1, 8), (3, 6), (5, 5)])
def test_a_set_that_a_batch_does_not_fill_is_left_out(planar_problem, random, objective, together, whole):
    term, c = Term(objective, together=together), planar_problem.start(8, random)
    value = term(planar_problem, c)
    assert float(value) == pytest.approx(float(term(planar_problem, c[:whole])), rel=1e-12)
    parts = [float(term(planar_problem, part)) for part in c[:whole].split(together)]
    assert float(value) == pytest.approx(sum(parts) / len(parts), rel=1e-9)
