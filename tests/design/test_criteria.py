import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design.criteria import DETERMINANT, criteria_of, inverse, variance
from sidegan.errors import ShapeError

seeds = st.integers(0, 2**32 - 1)


def definite(seed, count=1, size=4):
    generator = torch.Generator().manual_seed(seed)
    rows = torch.randn(count, size + 2, size, generator=generator, dtype=torch.float64)
    return rows.mT @ rows


def test_a_diagonal_set_by_hand():
    found = criteria_of(torch.diag(torch.tensor([4.0, 1.0, 0.5], dtype=torch.float64)))
    assert found.log_det == pytest.approx(math.log(2.0))
    assert found.trace_inverse == pytest.approx(0.25 + 1 + 2)
    assert found.covariance_norm == pytest.approx(math.sqrt(0.25**2 + 1 + 4))
    assert found.condition == pytest.approx(8.0)


@settings(deadline=None)
@given(seeds)
def test_criteria_are_those_of_the_inverse(seed):
    matrix = definite(seed)[0]
    found, covariance = criteria_of(matrix), torch.linalg.inv(matrix)
    assert found.log_det == pytest.approx(float(torch.linalg.slogdet(matrix)[1]), abs=1e-9)
    assert found.trace_inverse == pytest.approx(float(torch.linalg.inv(matrix).trace()), rel=1e-6)
    assert found.covariance_norm == pytest.approx(float(covariance.diagonal().norm()), rel=1e-6)
    assert found.condition == pytest.approx(float(torch.linalg.cond(matrix)), rel=1e-6)


def test_a_singular_set_tells_nothing_of_some_direction():
    row = torch.ones(1, 3, dtype=torch.float64)
    for matrix in (row.T @ row, torch.zeros(3, 3)):
        assert criteria_of(matrix) == (-math.inf, math.inf, math.inf, math.inf)


def test_values_are_logarithms_of_determinant_and_variances():
    matrices, target = definite(0, 5), definite(1)[0]
    inverses = torch.linalg.inv(matrices)
    torch.testing.assert_close(DETERMINANT.value(matrices), torch.linalg.slogdet(matrices)[1])
    traces = torch.stack([x.trace() for x in inverses])
    torch.testing.assert_close(variance().value(matrices), -traces.log())
    aimed = torch.stack([(target @ x).trace() for x in inverses])
    torch.testing.assert_close(variance(target).value(matrices), -aimed.log())


def test_a_target_may_be_one_direction():
    direction = torch.tensor([[1.0], [0.0], [2.0], [0.0]], dtype=torch.float64)
    matrix = definite(3)
    wanted = float(direction.T @ torch.linalg.inv(matrix[0]) @ direction)
    found = variance(direction @ direction.T).value(matrix)
    assert float(found) == pytest.approx(-math.log(wanted))


@pytest.mark.parametrize("criterion", [DETERMINANT, variance()])
def test_what_is_not_definite_has_no_value(criterion):
    matrices = torch.stack([torch.eye(3), -torch.eye(3), torch.zeros(3, 3)]).double()
    value = criterion.value(matrices)
    assert value[0].isfinite() and value[1:].tolist() == [-math.inf, -math.inf]


@settings(deadline=None)
@given(seeds, st.sampled_from(["determinant", "parameters", "target"]), st.floats(0.01, 100))
def test_a_tangent_is_never_below_the_criterion_and_touches_it(seed, kind, scale):
    target = definite(seed + 2)[0]
    criterion = {"determinant": DETERMINANT, "parameters": variance(), "target": variance(target)}[kind]
    reference, others = definite(seed)[0], definite(seed + 1, 20)
    weight, bound = criterion.tangent(reference)
    assert (criterion.value(others) <= bound((weight * others).sum((1, 2))) + 1e-9).all()
    touching = scale * reference
    assert float(bound((weight * touching).sum())) == pytest.approx(
        float(criterion.value(touching[None])), abs=1e-8
    )


def test_the_inverse_is_one():
    matrix = definite(7)[0]
    torch.testing.assert_close(inverse(matrix) @ matrix, torch.eye(4, dtype=torch.float64))


@pytest.mark.parametrize("matrix", [torch.ones(3), torch.ones(2, 3), torch.ones(0, 0)])
def test_a_wrong_shape_is_refused(matrix):
    with pytest.raises(ShapeError, match=r"expected \(q, q\)"):
        criteria_of(matrix)


def test_what_is_not_finite_is_refused():
    with pytest.raises(ShapeError, match="not finite"):
        criteria_of(torch.full((2, 2), torch.nan))


@pytest.mark.parametrize("target", [torch.ones(3), torch.ones(2, 3), torch.full((2, 2), torch.inf)])
def test_a_target_of_a_wrong_shape_is_refused(target):
    with pytest.raises(ShapeError, match="target is"):
        variance(target)


@pytest.mark.parametrize("target", [-torch.eye(2), torch.zeros(2, 2), torch.tensor([[1.0, 0.5], [0.0, 1.0]])])
def test_a_target_that_weighs_no_variance_is_refused(target):
    with pytest.raises(ShapeError, match="semidefinite"):
        variance(target)


def test_a_target_of_other_parameters_is_refused():
    criterion = variance(torch.eye(3))
    with pytest.raises(ShapeError, match="3 parameters for information on 4"):
        criterion.value(definite(0))
    with pytest.raises(ShapeError, match="3 parameters for information on 4"):
        criterion.tangent(definite(0)[0])
