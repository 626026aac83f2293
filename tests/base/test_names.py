"""Numbers for people."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidegan.base.names import plain


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [
        (177.4, ".3g", "177"),
        (131.6, ".2g", "130"),
        (7940.4, ".3g", "7940"),
        (-99950.0, ".3g", "-100000"),
        (999_400.0, ".3g", "999000"),
        (999_600.0, ".3g", "1e6"),
        (8.951e12, ".3g", "8.95e12"),
        (3.6e-7, ".2g", "3.6e-7"),
        (1e-10, ".3g", "1e-10"),
        (0.00047, ".3g", "0.00047"),
        (0.0, ".3g", "0"),
        (0.123, ".0%", "12%"),
        (1234.5, ",.0f", "1,234"),
        (12.0, "+.1f", "+12.0"),
        (math.inf, ".3g", "inf"),
        (math.nan, ".3g", "nan"),
    ],
)
def test_numbers_have_no_exponent_where_they_are_short(value: float, form: str, text: str) -> None:
    assert plain(value, form) == text


@given(st.floats(allow_nan=False), st.integers(1, 6))
def test_a_plain_number_is_the_number_that_its_format_says(value: float, digits: int) -> None:
    assert float(plain(value, f".{digits}g")) == float(format(value, f".{digits}g"))
