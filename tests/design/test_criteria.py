import math

import pytest
import torch

from sidegan.design.criteria import criteria_of, root_of

from .conftest import semidefinite


def test_criteria_by_hand_and_on_random_matrices():
    found = criteria_of(torch.diag(torch.tensor([4.0, 1.0, 0.5], dtype=torch.float64)))
    assert (found.log_det, found.condition) == pytest.approx((math.log(2.0), 8.0))
    for matrix in semidefinite(0, 5):
        expected = float(torch.linalg.slogdet(matrix)[1]), float(torch.linalg.cond(matrix))
        assert criteria_of(matrix) == pytest.approx(expected, rel=1e-6)


def test_a_singular_set_tells_nothing_of_some_direction():
    row = torch.ones(1, 3, dtype=torch.float64)
    for matrix in (row.T @ row, torch.zeros(3, 3)):
        assert criteria_of(matrix) == (-math.inf, math.inf)


@pytest.mark.parametrize("rank", [1, 2, 6])
def test_a_root_times_its_transpose_is_the_matrix(rank):
    matrix = semidefinite(1, rank=rank)[0]
    root = root_of(matrix)
    torch.testing.assert_close(root @ root.T, matrix)
