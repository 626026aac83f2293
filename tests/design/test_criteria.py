import math

import numpy as np
import pytest

from sidegan.design.criteria import condition_of, root_of

from .conftest import semidefinite


def test_the_condition_number_is_numpys_and_infinite_where_a_direction_is_not_excited():
    for matrix in semidefinite(0, 5):
        assert condition_of(matrix) == pytest.approx(float(np.linalg.cond(matrix)), rel=1e-6)
    for matrix in (np.ones((3, 3)), np.zeros((3, 3))):
        assert condition_of(matrix) == math.inf


@pytest.mark.parametrize("rank", [1, 2, 6])
def test_a_root_times_its_transpose_is_the_matrix(rank):
    matrix = semidefinite(1, rank=rank)[0]
    root = root_of(matrix)
    np.testing.assert_allclose(root @ root.T, matrix, atol=1e-12)
