"""What a user gives as numbers are real numbers."""

import numpy as np
import pytest

from sidegan.base.arrays import numbers
from sidegan.errors import ShapeError
from tests.refusals import refused


@pytest.mark.parametrize("given", [np.array([1 + 2j]), [1.0, 2j], "abc", [[1.0], [2.0, 3.0]]])
def test_what_is_no_array_of_real_numbers_is_refused_by_name(given):
    assert numbers([1, 2.5], "q").tolist() == [1.0, 2.5]
    with refused(ShapeError, "q"):
        numbers(given, "q")
