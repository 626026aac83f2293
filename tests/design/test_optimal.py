import itertools
import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design import optimal
from sidegan.design.criteria import DETERMINANT, variance
from sidegan.design.excitation import excite
from sidegan.design.greedy import greedy
from sidegan.design.information import Information, information_of
from sidegan.design.optimal import a_optimal, ceiling, d_optimal
from sidegan.design.selection import Selection, choose

seeds = st.integers(0, 2**32 - 1)
ranks = st.integers(1, 6)
CRITERIA = {"determinant": DETERMINANT, "parameters": variance()}
pick_of = {"determinant": d_optimal, "parameters": a_optimal}
kinds = st.sampled_from(sorted(CRITERIA))


def candidates(seed, count, size=4, rank=3):
    """Information of candidates that differ in size and direction."""
    generator = torch.Generator().manual_seed(seed)
    rows = torch.randn(count, rank, size, generator=generator, dtype=torch.float64)
    rows *= torch.rand(count, 1, size, generator=generator, dtype=torch.float64) ** 2
    return rows.mT @ rows


def prior_of(size=4, share=0.05):
    return share * torch.eye(size, dtype=torch.float64)


def value(criterion, matrices, chosen, prior):
    return float(criterion.value((prior + matrices[list(chosen)].sum(0))[None]))


def plain(criterion, matrices, count, prior):
    """The greedy pick as one would write it down."""
    chosen = []
    for _ in range(count):
        left = [i for i in range(len(matrices)) if i not in chosen]
        reached = {i: value(criterion, matrices, [*chosen, i], prior) for i in left}
        best = max(reached.values())
        chosen.append(min(i for i in left if reached[i] >= best - 1e-9))
    return chosen


def assert_greedy(criterion, information, order, matrices):
    """Every choice is the best that is left, up to rounding, with the prior that nobody gave."""
    for k, one in enumerate(order):
        reached = criterion.value(information.prior() + matrices[order[:k]].sum(0) + matrices)
        left = [i for i in range(len(matrices)) if i not in order[:k]]
        assert one in left and reached[one] >= reached[left].max() - 1e-7


def largest(criterion, matrices, count, prior):
    """The criterion of the best of all sets."""
    sets = itertools.combinations(range(len(matrices)), count)
    return max(value(criterion, matrices, chosen, prior) for chosen in sets)


@settings(deadline=None, max_examples=50)
@given(seeds, kinds, ranks, st.integers(1, 40), st.booleans(), st.data())
def test_lazy_is_plain(seed, kind, rank, number, few, data):
    """Also when few are evaluated at once, and, where one trajectory excites everything, by any prior."""
    count, anything = data.draw(st.integers(1, min(number, 10))), kind == "determinant" and rank > 4
    prior = prior_of(share=data.draw(st.floats(1e-12, 1e3)) if anything else 0.05)
    matrices = candidates(seed, number, rank=rank)
    with pytest.MonkeyPatch.context() as patch:
        if few:
            patch.setattr(optimal, "_FIRST", 1)
            patch.setattr(optimal, "_MOST", 2)
        found = pick_of[kind](Information.of(matrices), count, prior)
    assert found.tolist() == plain(CRITERIA[kind], matrices, count, prior)


def test_few_candidates_are_evaluated(monkeypatch):
    matrices = candidates(0, 3000, size=10, rank=30)
    seen = []

    def counted(x):
        seen.append(len(x))
        return DETERMINANT.value(x)

    monkeypatch.setattr(optimal, "DETERMINANT", DETERMINANT._replace(value=counted))
    d_optimal(Information.of(matrices), 35)
    assert sum(seen) < 35 * len(matrices) / 5


@settings(deadline=None, max_examples=40)
@given(seeds, ranks, st.integers(1, 4), st.sampled_from([1e-3, 0.05, 1.0]))
def test_the_guarantee_on_every_set_there_is(seed, rank, count, share):
    matrices, prior = candidates(seed, 8, rank=rank), prior_of(share=share)
    nothing = float(DETERMINANT.value(prior[None]))
    chosen = d_optimal(Information.of(matrices), count, prior).tolist()
    gained = value(DETERMINANT, matrices, chosen, prior) - nothing
    assert gained >= (1 - 1 / math.e) * (largest(DETERMINANT, matrices, count, prior) - nothing) - 1e-9


@settings(deadline=None, max_examples=30)
@given(seeds, kinds)
def test_every_choice_gains_and_the_determinants_gains_shrink(seed, kind):
    matrices, prior = candidates(seed, 20), prior_of()
    order = pick_of[kind](Information.of(matrices), 12, prior).tolist()
    reached = [value(CRITERIA[kind], matrices, order[:k], prior) for k in range(13)]
    gains = [b - a for a, b in itertools.pairwise(reached)]
    assert min(gains) > -1e-9
    if kind == "determinant":
        assert all(b <= a + 1e-8 for a, b in itertools.pairwise(gains))


@settings(deadline=None, max_examples=40)
@given(seeds, kinds, ranks, st.integers(1, 4))
def test_no_set_is_above_the_ceiling(seed, kind, rank, count):
    matrices, prior, criterion = candidates(seed, 8, rank=rank), prior_of(), CRITERIA[kind]
    chosen = pick_of[kind](Information.of(matrices), count, prior)
    reached, most = ceiling(Information.of(matrices), chosen, criterion, prior)
    assert reached == pytest.approx(value(criterion, matrices, chosen.tolist(), prior), abs=1e-9)
    assert most >= largest(criterion, matrices, count, prior) - 1e-9


def test_the_ceiling_of_equal_candidates_is_reached():
    information = Information.of(torch.eye(3, dtype=torch.float64).expand(6, 3, 3))
    reached, most = ceiling(information, torch.tensor([0, 1]), DETERMINANT, prior_of(3))
    assert most == pytest.approx(reached) == pytest.approx(3 * math.log(2.05))


@settings(deadline=None, max_examples=15)
@given(seeds, st.sampled_from([2.0**-30, 0.3, 2.0**40]))
def test_neither_the_basis_nor_the_size_of_the_noise_matters(seed, scale):
    """The former to the determinant and to a target."""
    matrices = candidates(seed, 40)
    turn = torch.randn(4, 4, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    turn = turn + 3 * torch.eye(4)  # not orthogonal: units and mixtures of parameters
    turned = turn.T @ matrices @ turn
    one, two = Information.of(matrices), Information.of((turned + turned.mT) / 2)
    assert_greedy(DETERMINANT, one, d_optimal(two, 10).tolist(), matrices)
    assert_greedy(variance(one.mean), one, a_optimal(two, 10, target=two.mean).tolist(), matrices)
    scaled = Information.of(scale * matrices)
    for kind, pick in pick_of.items():
        assert_greedy(CRITERIA[kind], one, pick(scaled, 8).tolist(), matrices)
    reached, other = (ceiling(x, torch.arange(5))[0] for x in (one, two))
    assert reached == pytest.approx(other - 2 * float(turn.slogdet()[1]), abs=1e-6)


def test_units_and_a_target_say_what_must_be_certain():
    """1 / 9.05 + 1 / 1.05 < 1 / 1.05 + 1 / 2.05, until the first parameter's part is hardly any."""
    matrices = torch.diag_embed(torch.tensor([[9.0, 1.0], [1.0, 2.0]], dtype=torch.float64))
    units = torch.diag(torch.tensor([100.0, 1.0], dtype=torch.float64))
    for turn, wanted in ((torch.eye(2).double(), 0), (units, 1)):
        scaled = Information.of(turn @ matrices @ turn)
        assert a_optimal(scaled, 1, turn @ prior_of(2) @ turn).tolist() == [wanted]
        target = torch.diag(torch.nn.functional.one_hot(torch.tensor(wanted), 2).double())
        assert a_optimal(Information.of(matrices), 1, prior_of(2), target).tolist() == [wanted]


@pytest.mark.parametrize("pick", pick_of.values())
def test_the_first_of_equals_wins_and_no_one_is_chosen_twice(pick):
    information = Information.of(candidates(0, 1).expand(150, 4, 4))
    assert pick(information, 7, prior_of()).tolist() == list(range(7))
    twice = Information.of(candidates(6, 20).repeat(2, 1, 1))
    order = pick(twice, 10).tolist()
    assert pick(twice, 4).tolist() == order[:4]  # a shorter pick is the beginning of a longer one
    assert all(i < 20 or i - 20 in order[: order.index(i)] for i in order)


def test_it_follows_the_device(device):
    matrices = candidates(8, 100)
    there = Information.of(matrices.to(device))
    chosen = d_optimal(there, 8)
    assert chosen.device.type == device.type
    assert chosen.tolist() == d_optimal(Information.of(matrices), 8).tolist()


@pytest.mark.parametrize("noise", [None, [3.0, 0.5]])
@pytest.mark.parametrize("pick", [d_optimal, a_optimal])
def test_the_configured_pick_is_that_of_the_function_it_names(planar_problem, random, pick, noise):
    of = planar_problem.body, planar_problem.trajectory, planar_problem.start(40, random)
    deviation = None if noise is None else torch.tensor(noise, dtype=torch.float64)
    chosen = choose(Selection(5, pick.__name__, noise), *of, torch.zeros(0, 0))
    assert chosen.tolist() == pick(information_of(*of, deviation=deviation), 5).tolist()
    diagonal = excite(*of).diagonal
    assert choose(Selection(5, "greedy", None), *of, diagonal).tolist() == greedy(diagonal, 5).tolist()
