"""Picks from pools: the paper's rule in words, and optimal designs by their definitions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design.excitation import information_of, measure_excitation
from sidegan.design.selection import Candidates, Selection, a_optimal, choose, d_optimal, greedy

from .conftest import semidefinite


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
        # The maxima are over those left. From (100, 100): g = 68 and 116.6, f = 105 and 40, so d = 0.58 + 1
        # and 1 + 0.38. With the f = 200 of the one chosen it would be 0.58 + 0.53 and 1 + 0.2.
        ([[100, 100], [60, 45], [0, 40]], [0, 1]),
        # ‖a‖² − 2 a·b + ‖b‖² would lose the difference of 1e-9 and 2e-9 in rounding.
        ([[1.0, 1.0], [1.0 - 1e-9, 1.0 + 1e-9], [1.0 - 2e-9, 1.0 + 2e-9]], [0, 2, 1]),
    ],
)
def test_greedy_picks_worked_out_by_hand(rows, expected):
    assert greedy(np.array(rows, dtype=float), len(expected)).tolist() == expected


whole = st.integers(1, 4).flatmap(  # numbers whose sums and squares are exact, so that even ties must agree
    lambda p: st.lists(st.lists(st.integers(0, 6), min_size=p, max_size=p), min_size=1, max_size=14)
)
sizes = st.tuples(st.integers(1, 40), st.integers(1, 50))
real = st.builds(lambda x, size: np.random.default_rng(x).lognormal(size=size), st.integers(0, 999), sizes)


@settings(max_examples=60)
@given(whole | real, st.data())
def test_greedy_follows_the_papers_rule(rows, data):
    count = data.draw(st.integers(1, len(rows)))
    rows = np.array(rows, dtype=float)
    assert greedy(rows, count).tolist() == in_words(rows, count)


seeds = st.integers(0, 2**32 - 1)
VALUES = {  # of one matrix, to be made large
    "determinant": lambda matrix: float(np.linalg.slogdet(matrix).logabsdet),
    "parameters": lambda matrix: -math.log(float(np.linalg.inv(matrix).trace())),
}
PICKS = {"determinant": d_optimal, "parameters": a_optimal}
kinds = st.sampled_from(sorted(PICKS))


def candidates(seed, count, rank=3):
    """Information of candidates that differ in size and direction."""
    units = np.random.default_rng(seed).random((count, 1, 4)) ** 2
    return units * semidefinite(seed, count, rank=rank) * units.mT


def reached(kind, matrices, chosen):
    return VALUES[kind](1e-3 * matrices.mean(0) + matrices[list(chosen)].sum(0))


def assert_greedy(kind, matrices, order):
    """Every choice is the best that is left, up to rounding."""
    assert len({*order}) == len(order)
    for k, chosen in enumerate(order):
        left = [i for i in range(len(matrices)) if i not in order[:k]]
        values = {i: reached(kind, matrices, [*order[:k], i]) for i in left}
        assert values[chosen] >= max(values.values()) - 1e-7


@settings(max_examples=40)
@given(seeds, kinds, st.integers(3, 6), st.integers(4, 40) | st.just(1500), st.data())
def test_every_choice_is_the_best_remaining(seed, kind, rank, number, data):
    matrices = candidates(seed, number, rank=rank)
    count = data.draw(st.integers(1, min(number, 10) if number < 1000 else 2))
    order = PICKS[kind](matrices, count).tolist()
    assert_greedy(kind, matrices, order)
    assert PICKS[kind](matrices, 1).tolist() == order[:1]  # a shorter pick is the beginning of a longer one


@settings(max_examples=15)
@given(seeds, st.sampled_from([2.0**-30, 0.3, 2.0**40]))
def test_noise_scale_and_basis_do_not_change_optimal_designs(seed, scale):
    matrices = candidates(seed, 40)
    turn = np.random.default_rng(seed).standard_normal((4, 4))
    turn = turn + 3 * np.eye(4)  # not orthogonal: units and mixtures of parameters
    turned = turn.T @ matrices @ turn
    assert_greedy("determinant", matrices, d_optimal((turned + turned.mT) / 2, 10).tolist())
    for kind, pick in PICKS.items():
        assert_greedy(kind, matrices, pick(scale * matrices, 8).tolist())


@pytest.mark.parametrize("pick", PICKS.values())
def test_ties_go_to_the_first(pick):
    assert pick(np.tile(np.eye(4), (150, 1, 1)), 7).tolist() == list(range(7))
    order = pick(np.tile(candidates(6, 20), (2, 1, 1)), 10).tolist()
    assert all(i < 20 or i - 20 in order[: order.index(i)] for i in order)


@pytest.mark.parametrize("noise", [None, [3.0, 0.5]])
@pytest.mark.parametrize("pick", PICKS.values())
def test_the_configured_pick_is_that_of_the_function_it_names(planar_problem, random, pick, noise):
    body, family, c = planar_problem.body, planar_problem.trajectory, planar_problem.start(40, random)
    settings = Selection(count=5, method=pick.__name__, noise=noise)
    chosen = choose(settings, body, family, c, np.zeros((0, 0))).tolist()
    information = information_of(body, family, c, noise=noise)
    assert chosen == pick(information, 5).tolist()
    assert chosen == pick(Candidates(40, lambda index: information[index]), 5).tolist()  # made when looked at
    diagonal = measure_excitation(body, family, c).diagonal
    assert choose(Selection(count=5), body, family, c, diagonal).tolist() == greedy(diagonal, 5).tolist()
