import itertools
import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design import optimal
from sidegan.design.criteria import DETERMINANT, variance
from sidegan.design.information import Information
from sidegan.design.optimal import a_optimal, ceiling, d_optimal
from sidegan.errors import ShapeError

seeds = st.integers(0, 2**32 - 1)
ranks = st.integers(1, 6)
CRITERIA = {"determinant": DETERMINANT, "parameters": variance()}
both = pytest.mark.parametrize("criterion", CRITERIA.values(), ids=CRITERIA)
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


@settings(deadline=None)
@given(seeds, kinds, ranks, st.integers(1, 40), st.data())
def test_lazy_is_plain(seed, kind, rank, number, data):
    count = data.draw(st.integers(1, min(number, 12)))
    matrices, prior = candidates(seed, number, rank=rank), prior_of()
    found = pick_of[kind](Information.of(matrices), count, prior)
    assert found.tolist() == plain(CRITERIA[kind], matrices, count, prior)


@settings(deadline=None, max_examples=20)
@given(seeds, kinds, ranks)
def test_lazy_is_plain_when_few_are_evaluated_at_once(seed, kind, rank):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(optimal, "_FIRST", 1)
        patch.setattr(optimal, "_MOST", 2)
        matrices, prior = candidates(seed, 60, rank=rank), prior_of()
        found = pick_of[kind](Information.of(matrices), 8, prior)
    assert found.tolist() == plain(CRITERIA[kind], matrices, 8, prior)


@settings(deadline=None, max_examples=30)
@given(seeds, st.floats(1e-12, 1e3))
def test_lazy_is_plain_whatever_the_prior(seed, share):
    matrices, prior = candidates(seed, 30, rank=5), prior_of(share=share)
    found = d_optimal(Information.of(matrices), 6, prior)
    assert found.tolist() == plain(DETERMINANT, matrices, 6, prior)


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


@both
def test_a_shorter_pick_is_the_beginning_of_a_longer_one(criterion):
    pick = d_optimal if criterion is DETERMINANT else a_optimal
    information = Information.of(candidates(1, 200))
    assert torch.equal(pick(information, 5), pick(information, 20)[:5])


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


@settings(deadline=None, max_examples=25)
@given(seeds)
def test_the_basis_does_not_matter_to_the_determinant(seed):
    matrices = candidates(seed, 40)
    turn = torch.randn(4, 4, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    turn = turn + 3 * torch.eye(4)  # not orthogonal: units and mixtures of parameters
    one, two = Information.of(matrices), Information.of(symmetric(turn.T @ matrices @ turn))
    assert_greedy(DETERMINANT, one, d_optimal(two, 10).tolist(), matrices)
    start = torch.arange(5)
    assert ceiling(one, start)[0] == pytest.approx(
        ceiling(two, start)[0] - 2 * float(turn.slogdet()[1]), abs=1e-6
    )


@settings(deadline=None, max_examples=25)
@given(seeds)
def test_the_basis_does_not_matter_to_a_target(seed):
    matrices = candidates(seed, 40)
    turn = torch.randn(4, 4, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    turn = turn + 3 * torch.eye(4)
    one, two = Information.of(matrices), Information.of(symmetric(turn.T @ matrices @ turn))
    assert_greedy(variance(one.mean), one, a_optimal(two, 10, target=two.mean).tolist(), matrices)


@settings(deadline=None, max_examples=25)
@given(seeds, kinds, st.sampled_from([2.0**-30, 0.3, 2.0**40]))
def test_the_size_of_the_noise_does_not_matter(seed, kind, scale):
    matrices = candidates(seed, 40)
    pick = pick_of[kind]
    chosen = pick(Information.of(scale * matrices), 8).tolist()
    assert_greedy(CRITERIA[kind], Information.of(matrices), chosen, matrices)


def test_the_size_of_parameters_matters_to_their_variances():
    matrices = torch.diag_embed(torch.tensor([[9.0, 1.0], [1.0, 2.0]], dtype=torch.float64))
    units = torch.diag(torch.tensor([100.0, 1.0], dtype=torch.float64))
    # 1 / 9.05 + 1 / 1.05 is less than 1 / 1.05 + 1 / 2.05, until the first parameter's part is hardly any.
    assert a_optimal(Information.of(matrices), 1, prior_of(2)).tolist() == [0]
    scaled = Information.of(units @ matrices @ units)
    assert a_optimal(scaled, 1, units @ prior_of(2) @ units).tolist() == [1]


def test_a_target_says_what_must_be_certain():
    matrices = torch.diag_embed(torch.tensor([[9.0, 1.0], [1.0, 2.0]], dtype=torch.float64))
    for wanted in (0, 1):
        target = torch.diag(torch.nn.functional.one_hot(torch.tensor(wanted), 2).double())
        assert a_optimal(Information.of(matrices), 1, prior_of(2), target).tolist() == [wanted]


@both
def test_the_first_of_equals_wins_and_no_one_is_chosen_twice(criterion):
    pick = d_optimal if criterion is DETERMINANT else a_optimal
    information = Information.of(candidates(0, 1).expand(150, 4, 4))
    assert pick(information, 7, prior_of()).tolist() == list(range(7))
    twice = candidates(6, 20).repeat(2, 1, 1)
    order = pick(Information.of(twice), 10).tolist()
    assert all(i < 20 or i - 20 in order[: order.index(i)] for i in order)


def test_candidates_may_lie_in_a_file(tmp_path):
    information = Information.of(candidates(8, 300))
    kept = np.memmap(tmp_path / "packed", np.float64, "w+", shape=tuple(information.packed.shape))
    kept[:] = information.packed.numpy()
    mapped = Information(torch.from_numpy(kept))
    assert torch.equal(d_optimal(mapped, 8), d_optimal(information, 8))


def test_it_follows_the_device(device):
    matrices = candidates(8, 100)
    there = Information.of(matrices.to(device))
    chosen = d_optimal(there, 8)
    assert chosen.device.type == device.type
    assert chosen.tolist() == d_optimal(Information.of(matrices), 8).tolist()


def test_four_thousand_trajectories_are_no_matter():
    packed = Information.of(candidates(0, 200, size=43, rank=80)).packed
    generator = torch.Generator().manual_seed(0)
    shares = torch.rand(4_000, 200, generator=generator, dtype=torch.float64) ** 8
    information = Information(shares @ packed)
    for pick in (d_optimal, a_optimal):
        assert len(pick(information, 35).unique()) == 35


@pytest.mark.parametrize("pick", [d_optimal, a_optimal])
@pytest.mark.parametrize("count", [0, -1, 7])
def test_a_count_that_cannot_be_is_refused(pick, count):
    with pytest.raises(ShapeError, match=f"{count} of 6"):
        pick(Information.of(candidates(0, 6)), count)


@pytest.mark.parametrize("pick", [d_optimal, a_optimal])
def test_an_empty_library_is_refused(pick):
    with pytest.raises(ShapeError, match="of 0"):
        pick(Information(torch.ones(0, 10)), 1)


@pytest.mark.parametrize(
    "prior",
    [torch.eye(3), torch.ones(4), -torch.eye(4), torch.zeros(4, 4), math.nan * torch.eye(4)],
)
def test_a_prior_that_cannot_be_is_refused(prior):
    information = Information.of(candidates(0, 6))
    for work in (
        lambda: d_optimal(information, 2, prior),
        lambda: a_optimal(information, 2, prior),
        lambda: ceiling(information, torch.arange(2), prior=prior),
    ):
        with pytest.raises(ShapeError, match="prior is"):
            work()


def test_a_prior_that_is_not_symmetric_is_refused():
    prior = prior_of()
    prior[0, 1] = 0.01
    with pytest.raises(ShapeError, match="symmetric"):
        d_optimal(Information.of(candidates(0, 6)), 2, prior)


def test_a_direction_that_no_one_excites_needs_a_prior():
    flat = torch.diag_embed(torch.rand(6, 4, dtype=torch.float64))
    flat[:, 2, 2] = 0.0
    with pytest.raises(ShapeError, match="give a prior"):
        d_optimal(Information.of(flat), 2)
    assert len(d_optimal(Information.of(flat), 2, prior_of())) == 2


@pytest.mark.parametrize("chosen", [[], [0, 6], [-1], [1, 1], [0.0, 1.0]])
def test_a_set_that_cannot_be_is_refused(chosen):
    information = Information.of(candidates(0, 6))
    with pytest.raises(ShapeError, match="indices are"):
        ceiling(information, torch.tensor(chosen))


def test_a_target_of_other_parameters_is_refused():
    with pytest.raises(ShapeError, match="target of 3"):
        a_optimal(Information.of(candidates(0, 6)), 2, target=torch.eye(3))


def symmetric(matrices):
    return (matrices + matrices.mT) / 2
