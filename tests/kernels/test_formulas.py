"""Formulas that kernels and plain torch share, by closed forms."""

import pytest

from sidegan.kernels.formulas import multiplied, scaled, summed


@pytest.mark.parametrize("a, b", [(0.3, 2.0), (1.7, 0.4), (5.0, 3.0)])
def test_bounds_of_products_and_sums_are_the_derivatives_of_exponentials(a, b):
    """exp(a t) has the derivatives 1, a, a² at 0: bounds with equality, those of a product too."""
    one, other = (1.0, a, a * a), (2.0, 2 * b, 2 * b * b)
    assert multiplied(one, other) == pytest.approx((2.0, 2 * (a + b), 2 * (a + b) ** 2))
    assert summed(one, other) == pytest.approx((3.0, a + 2 * b, a * a + 2 * b * b))
    assert scaled(0.5, other) == pytest.approx((1.0, b, b * b))
