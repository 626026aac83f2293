import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sidegan.design.greedy import greedy
from sidegan.errors import ShapeError


def tensor(rows):
    return torch.tensor(rows, dtype=torch.float64)


def in_words(diagonals, count):
    """The paper's rule, one trajectory at a time."""
    left, chosen = list(range(len(diagonals))), []
    previous = np.zeros(len(diagonals[0]))
    while len(chosen) < count:
        g = {i: np.sqrt(sum((np.array(diagonals[i]) - previous) ** 2)) for i in left}
        f = {i: float(sum(diagonals[i])) for i in left}
        largest_g, largest_f = max(g.values()), max(f.values())
        d = {i: (g[i] / largest_g if largest_g else 0) + (f[i] / largest_f if largest_f else 0) for i in left}
        best = min(left, key=lambda i: (-d[i], i))
        chosen.append(best)
        left.remove(best)
        previous = np.array(diagonals[best])
    return chosen


def test_three_trajectories_by_hand():
    # First: g = 3, 4, 5 and f = 3, 4, 7, so d = 1.03, 1.37, 2. Then, from (3, 4): g = 4, 3 of 4 and
    # f = 3, 4 of 4, so both have d = 1.75 and the first wins.
    assert greedy(tensor([[3, 0], [0, 4], [3, 4]]), 3).tolist() == [2, 0, 1]


def test_what_is_far_from_the_previous_choice_comes_before_what_is_larger():
    # From (10, 0): (9, 0) has g = 1 / 12.2 and f = 1, (0, 7) has g = 1 and f = 7 / 9.
    assert greedy(tensor([[10, 0], [9, 0], [0, 7]]), 2).tolist() == [0, 2]


def test_the_maxima_are_over_those_that_are_left():
    # From (100, 100): g = 68 and 116.6, f = 105 and 40, so d = 0.58 + 1 and 1 + 0.38. With the f = 200 of
    # the one already chosen as the maximum it would be 0.58 + 0.53 and 1 + 0.2.
    assert greedy(tensor([[100, 100], [60, 45], [0, 40]]), 2).tolist() == [0, 1]


def test_the_first_of_equals_wins_and_no_one_is_chosen_twice():
    assert greedy(torch.ones(5, 3), 5).tolist() == [0, 1, 2, 3, 4]
    assert greedy(torch.zeros(4, 3), 4).tolist() == [0, 1, 2, 3]


def test_choosing_all_gives_a_permutation():
    order = greedy(torch.rand(30, 4, dtype=torch.float64), 30)
    assert order.dtype == torch.long and sorted(order.tolist()) == list(range(30))


whole_rows = st.integers(1, 4).flatmap(
    lambda p: st.lists(st.lists(st.integers(0, 6), min_size=p, max_size=p), min_size=1, max_size=14)
)


@given(whole_rows, st.data())
def test_the_rule_of_the_paper(rows, data):
    # Whole numbers: sums and squares are exact, so even ties must agree.
    count = data.draw(st.integers(1, len(rows)))
    assert greedy(tensor(rows), count).tolist() == in_words(tensor(rows).numpy(), count)


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.integers(1, 50))
def test_the_rule_of_the_paper_on_random_numbers(seed, trajectories, parameters):
    rows = np.random.default_rng(seed).lognormal(size=(trajectories, parameters))
    assert greedy(torch.from_numpy(rows), trajectories).tolist() == in_words(rows, trajectories)


@given(st.integers(0, 2**32 - 1), st.sampled_from([2.0**-40, 0.5, 2.0**60]))
def test_the_unit_of_the_diagonal_does_not_matter(seed, unit):
    rows = torch.from_numpy(np.random.default_rng(seed).lognormal(size=(20, 3)))
    assert torch.equal(greedy(rows, 20), greedy(rows * unit, 20))


def test_a_shorter_pick_is_the_beginning_of_a_longer_one():
    rows = torch.rand(200, 6, dtype=torch.float64)
    assert torch.equal(greedy(rows, 35), greedy(rows, 90)[:35])


def test_near_neighbours_far_from_zero_are_told_apart():
    # ‖a‖² − 2 a·b + ‖b‖² would lose the difference of 1e-9 and 2e-9 in rounding.
    rows = tensor([[1.0, 1.0], [1.0 - 1e-9, 1.0 + 1e-9], [1.0 - 2e-9, 1.0 + 2e-9]])
    assert greedy(rows, 3).tolist() == [0, 2, 1]


def test_precision_and_input_are_kept():
    rows = torch.rand(20, 3)
    before = rows.clone()
    assert torch.equal(greedy(rows, 5), greedy(rows.double(), 5))
    assert torch.equal(rows, before)


def test_twenty_thousand_trajectories_are_no_matter():
    rows = torch.rand(20_000, 43, dtype=torch.float64)
    assert len(greedy(rows, 100).unique()) == 100


@pytest.mark.parametrize("count", [0, -1, 4])
def test_a_count_that_cannot_be_is_refused(count):
    with pytest.raises(ShapeError, match=f"{count} of 3"):
        greedy(torch.ones(3, 2), count)


@pytest.mark.parametrize("shape", [(3,), (3, 2, 2), (3, 0)])
def test_a_wrong_shape_is_refused(shape):
    with pytest.raises(ShapeError, match=r"\(N, p\)"):
        greedy(torch.ones(shape), 1)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1e-3])
def test_what_no_diagonal_can_be_is_refused(value):
    rows = torch.ones(4, 2)
    rows[2, 1] = value
    with pytest.raises(ShapeError, match="trajectory 2"):
        greedy(rows, 2)


def test_an_empty_library_is_refused():
    with pytest.raises(ShapeError, match="of 0"):
        greedy(torch.ones(0, 2), 1)
