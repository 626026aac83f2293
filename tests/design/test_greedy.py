import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design.greedy import greedy


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


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        # First: g = 3, 4, 5 and f = 3, 4, 7, so d = 1.03, 1.37, 2. Then, from (3, 4): g = 4, 3 of 4 and
        # f = 3, 4 of 4, so both have d = 1.75 and the first wins.
        ([[3, 0], [0, 4], [3, 4]], [2, 0, 1]),
        # Far from the previous choice comes before larger. From (10, 0): (9, 0) has g = 1 / 12.2 and f = 1,
        # (0, 7) has g = 1 and f = 7 / 9.
        ([[10, 0], [9, 0], [0, 7]], [0, 2]),
        # The maxima are over those left. From (100, 100): g = 68 and 116.6, f = 105 and 40, so d = 0.58 + 1
        # and 1 + 0.38. With the f = 200 of the one chosen it would be 0.58 + 0.53 and 1 + 0.2.
        ([[100, 100], [60, 45], [0, 40]], [0, 1]),
        # ‖a‖² − 2 a·b + ‖b‖² would lose the difference of 1e-9 and 2e-9 in rounding.
        ([[1.0, 1.0], [1.0 - 1e-9, 1.0 + 1e-9], [1.0 - 2e-9, 1.0 + 2e-9]], [0, 2, 1]),
        # The first of equals wins and no one is chosen twice.
        ([[1, 1, 1]] * 5, [0, 1, 2, 3, 4]),
        ([[0, 0, 0]] * 4, [0, 1, 2, 3]),
    ],
)
def test_by_hand(rows, expected):
    assert greedy(np.array(rows, dtype=float), len(expected)).tolist() == expected


whole = st.integers(1, 4).flatmap(  # numbers whose sums and squares are exact, so that even ties must agree
    lambda p: st.lists(st.lists(st.integers(0, 6), min_size=p, max_size=p), min_size=1, max_size=14)
)
sizes = st.tuples(st.integers(1, 40), st.integers(1, 50))
real = st.builds(lambda x, size: np.random.default_rng(x).lognormal(size=size), st.integers(0, 999), sizes)


@settings(max_examples=60)
@given(whole | real, st.data())
def test_the_rule_of_the_paper(rows, data):
    count = data.draw(st.integers(1, len(rows)))
    rows = np.array(rows, dtype=float)
    assert greedy(rows, count).tolist() == in_words(rows, count)
