import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design.criteria import DETERMINANT, criteria_of, inverse, variance

from .conftest import semidefinite

seeds = st.integers(0, 2**32 - 1)


def test_a_diagonal_set_by_hand():
    found = criteria_of(torch.diag(torch.tensor([4.0, 1.0, 0.5], dtype=torch.float64)))
    assert found.log_det == pytest.approx(math.log(2.0))
    assert found.trace_inverse == pytest.approx(0.25 + 1 + 2)
    assert found.covariance_norm == pytest.approx(math.sqrt(0.25**2 + 1 + 4))
    assert found.condition == pytest.approx(8.0)


@settings(deadline=None, max_examples=40)
@given(seeds)
def test_criteria_are_those_of_the_inverse(seed):
    matrix = semidefinite(seed)[0]
    found, covariance = criteria_of(matrix), torch.linalg.inv(matrix)
    torch.testing.assert_close(inverse(matrix) @ matrix, torch.eye(4, dtype=torch.float64))
    assert found.log_det == pytest.approx(float(torch.linalg.slogdet(matrix)[1]), abs=1e-9)
    assert found.trace_inverse == pytest.approx(float(covariance.trace()), rel=1e-6)
    assert found.covariance_norm == pytest.approx(float(covariance.diagonal().norm()), rel=1e-6)
    assert found.condition == pytest.approx(float(torch.linalg.cond(matrix)), rel=1e-6)


def test_a_singular_set_tells_nothing_of_some_direction():
    row = torch.ones(1, 3, dtype=torch.float64)
    for matrix in (row.T @ row, torch.zeros(3, 3)):
        assert criteria_of(matrix) == (-math.inf, math.inf, math.inf, math.inf)


def test_values_are_logarithms_of_determinant_and_variances():
    matrices = semidefinite(0, 5)
    inverses = torch.linalg.inv(matrices)
    torch.testing.assert_close(DETERMINANT.value(matrices), torch.linalg.slogdet(matrices)[1])
    torch.testing.assert_close(variance().value(matrices), -inverses.diagonal(dim1=1, dim2=2).sum(1).log())
    for target in (semidefinite(1)[0], semidefinite(1, rank=1)[0]):  # the latter is one direction
        aimed = torch.stack([(target @ x).trace() for x in inverses])
        torch.testing.assert_close(variance(target).value(matrices), -aimed.log())


def test_what_is_not_definite_has_no_value():
    matrices = torch.stack([-torch.eye(3), torch.zeros(3, 3)]).double()
    for criterion in (DETERMINANT, variance()):
        assert criterion.value(matrices).tolist() == [-math.inf, -math.inf]


@settings(deadline=None, max_examples=40)
@given(seeds, st.sampled_from(["determinant", "parameters", "target"]), st.floats(0.01, 100))
def test_a_tangent_is_never_below_the_criterion_and_touches_it(seed, kind, scale):
    target = semidefinite(seed + 2)[0]
    criterion = {"determinant": DETERMINANT, "parameters": variance(), "target": variance(target)}[kind]
    reference, others = semidefinite(seed)[0], semidefinite(seed + 1, 20)
    weight, bound = criterion.tangent(reference)
    assert (criterion.value(others) <= bound((weight * others).sum((1, 2))) + 1e-9).all()
    touching = scale * reference
    assert float(bound((weight * touching).sum())) == pytest.approx(
        float(criterion.value(touching[None])), abs=1e-8
    )
