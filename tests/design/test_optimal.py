import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design import optimal, selection
from sidegan.design.excitation import excite
from sidegan.design.greedy import greedy
from sidegan.design.information import information_of
from sidegan.design.optimal import a_optimal, d_optimal
from sidegan.design.selection import Selection, choose

seeds = st.integers(0, 2**32 - 1)
VALUES = {  # of one matrix, to be made large
    "determinant": lambda matrix: float(np.linalg.slogdet(matrix).logabsdet),
    "parameters": lambda matrix: -math.log(float(np.linalg.inv(matrix).trace())),
}
PICKS = {"determinant": d_optimal, "parameters": a_optimal}
kinds = st.sampled_from(sorted(PICKS))


def candidates(seed, count, size=4, rank=3):
    """Information of candidates that differ in size and direction."""
    generator = np.random.default_rng(seed)
    rows = generator.standard_normal((count, rank, size))
    rows *= generator.random((count, 1, size)) ** 2
    return rows.mT @ rows


def reached(kind, matrices, chosen):
    return VALUES[kind](1e-3 * matrices.mean(0) + matrices[list(chosen)].sum(0))


def assert_greedy(kind, matrices, order):
    """Every choice is the best that is left, up to rounding."""
    assert len({*order}) == len(order)
    for k, one in enumerate(order):
        left = [i for i in range(len(matrices)) if i not in order[:k]]
        values = {i: reached(kind, matrices, [*order[:k], i]) for i in left}
        assert values[one] >= max(values.values()) - 1e-7


@settings(deadline=None, max_examples=40)
@given(seeds, kinds, st.integers(3, 6), st.integers(4, 40), st.booleans(), st.data())
def test_every_choice_is_the_best_that_is_left(seed, kind, rank, number, few, data):
    matrices = candidates(seed, number, rank=rank)
    with pytest.MonkeyPatch.context() as patch:
        if few:
            patch.setattr(optimal, "_AT_ONCE", 3)
        order = PICKS[kind](matrices, data.draw(st.integers(1, min(number, 10)))).tolist()
    assert_greedy(kind, matrices, order)
    assert PICKS[kind](matrices, 1).tolist() == order[:1]  # a shorter pick is the beginning of a longer one


@settings(deadline=None, max_examples=15)
@given(seeds, st.sampled_from([2.0**-30, 0.3, 2.0**40]))
def test_the_size_of_the_noise_does_not_matter_nor_the_basis_to_the_determinant(seed, scale):
    matrices = candidates(seed, 40)
    turn = np.random.default_rng(seed).standard_normal((4, 4))
    turn = turn + 3 * np.eye(4)  # not orthogonal: units and mixtures of parameters
    turned = turn.T @ matrices @ turn
    assert_greedy("determinant", matrices, d_optimal((turned + turned.mT) / 2, 10).tolist())
    for kind, pick in PICKS.items():
        assert_greedy(kind, matrices, pick(scale * matrices, 8).tolist())


@pytest.mark.parametrize("pick", PICKS.values())
def test_the_first_of_equals_wins(pick):
    assert pick(np.tile(np.eye(4), (150, 1, 1)), 7).tolist() == list(range(7))
    order = pick(np.tile(candidates(6, 20), (2, 1, 1)), 10).tolist()
    assert all(i < 20 or i - 20 in order[: order.index(i)] for i in order)


@pytest.mark.parametrize("noise", [None, [3.0, 0.5]])
@pytest.mark.parametrize("pick", PICKS.values())
def test_the_configured_pick_is_that_of_the_function_it_names(
    planar_problem, random, pick, noise, monkeypatch
):
    of = planar_problem.body, planar_problem.trajectory, planar_problem.start(40, random)
    for held in (40, 39):  # at once, or made when it is looked at
        monkeypatch.setattr(selection, "_HELD", held)
        chosen = choose(Selection(count=5, method=pick.__name__, noise=noise), *of, np.zeros((0, 0)))
        assert chosen.tolist() == pick(information_of(*of, noise=noise), 5).tolist()
    diagonal = excite(*of).diagonal
    assert choose(Selection(count=5), *of, diagonal).tolist() == greedy(diagonal, 5).tolist()
