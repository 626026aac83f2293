"""Excitation and diversity: the full YᵀY and closed forms as oracles."""

import math

import pytest
import torch

from sidegan.design import excitation
from sidegan.design.excitation import Excitation, effective_rank, excite, mean_distance, nearest_distance
from sidegan.motion.dynamics import RigidBody
from tests.chains import random_chain

from .conftest import trajectories


@pytest.mark.parametrize("joints", [0, 1, 2, 4])
def test_spectrum_trace_and_diagonal_are_those_of_the_full_regressor(joints, arm):
    arm = random_chain(joints, 0)[0] if joints else arm
    body, (trajectory, c) = RigidBody(arm), trajectories(arm.joints)
    excitation = excite(body, trajectory, c)
    y = body.regressor(*trajectory.roll_out(c, trajectory.grid(80))[1:]).flatten(1, 2)
    gram, p = y.mT @ y / 80, body.parameters_count
    eigenvalues, diagonal = torch.linalg.eigvalsh(gram), gram.diagonal(dim1=1, dim2=2)
    noise = 1e-13 * eigenvalues[:, -1:]
    assert (eigenvalues[:, :-p].abs() <= noise).all()
    assert ((excitation.spectrum - eigenvalues[:, -p:]).abs() <= noise + 1e-9 * eigenvalues[:, -p:]).all()
    torch.testing.assert_close(excitation.spectrum.sum(1), diagonal.sum(1))
    torch.testing.assert_close(excitation.diagonal, diagonal[:, body.base.columns])


def test_fitnesses_are_ratios_of_extremes():
    spectrum = torch.tensor([[2.0, 3.0, 8.0], [1e-9, 1.0, 1.0]], dtype=torch.float64)
    diagonal = torch.tensor([[5.0, 1.0, 2.0], [7.0, 3.5, 7.0]], dtype=torch.float64)
    excitation = Excitation(spectrum, diagonal)
    torch.testing.assert_close(excitation.eigenvalue_fitness, torch.tensor([4.0, 1e9], dtype=torch.float64))
    assert excitation.diagonal_fitness.tolist() == [5.0, 2.0]
    for low in (0.0, -1e-18, 4e-16):  # an unexcited direction
        spectrum = torch.tensor([[low, 0.5, 1.0]], dtype=torch.float64)
        assert Excitation(spectrum, spectrum).eigenvalue_fitness.item() == math.inf


@pytest.mark.parametrize(
    ("x", "mean", "nearest"),
    [
        (torch.tensor([[0, 0], [3, 0], [0, 4], [3, 4]]), (2 * 3 + 2 * 4 + 2 * 5) / 6, 3.0),
        (torch.eye(12).reshape(12, 2, 3, 2), math.sqrt(2), math.sqrt(2)),
        (torch.tensor([[0.0], [10.0]]).repeat(5, 1), 10 * 25 / 45, 0.0),  # modes far apart
    ],
)
def test_distances_by_hand(x, mean, nearest):
    assert mean_distance(x.double()) == pytest.approx(mean)
    assert nearest_distance(x.double()) == pytest.approx(nearest)


@pytest.mark.parametrize(
    ("squares", "rank"),
    [([], 0.0), ([1], 1.0), ([1] * 7, 7.0), ([3, 1], 4 / 3**0.75)],  # exp of the entropy of ¾ and ¼
)
def test_effective_rank_by_hand(squares, rank):
    steps = torch.diag(torch.tensor(squares + [0.0] * (9 - len(squares)), dtype=torch.float64).sqrt())
    assert effective_rank(torch.cat([steps, -steps]) + 100.0) == pytest.approx(rank)


def test_effective_rank_does_not_depend_on_scale_or_basis():
    generator = torch.Generator().manual_seed(0)
    x = torch.randn(200, 6, generator=generator, dtype=torch.float64) * torch.arange(1, 7)
    turn = torch.linalg.qr(torch.randn(6, 6, generator=generator, dtype=torch.float64))[0]
    assert effective_rank(1e-7 * x @ turn - 5.0) == pytest.approx(effective_rank(x), rel=1e-6)


def test_a_single_trajectory_has_nothing_to_differ_from():
    one = torch.zeros(1, 2, 3, 2, dtype=torch.float64)
    assert excitation.diversity(one, Excitation(torch.ones(1, 5), torch.ones(1, 8))) == {}


def _rows(count):
    return torch.randn(count, 2, 3, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(count))


@pytest.mark.parametrize("held", [1, 7, 2000])
def test_blocks_change_no_bit_of_the_nearest_distance(held, monkeypatch):
    rows = _rows(933).flatten(1)
    exact = torch.cdist(rows, rows, compute_mode="donot_use_mm_for_euclid_dist").fill_diagonal_(torch.inf)
    monkeypatch.setattr(excitation, "_AT_ONCE", held)
    assert nearest_distance(rows).hex() == float(exact.amin(1).mean()).hex()


def test_a_sample_of_a_large_set_tells_nearly_the_same(monkeypatch):
    x = _rows(3000)
    exact = nearest_distance(x), mean_distance(x)
    monkeypatch.setattr(excitation, "_EXACT", 2999)
    monkeypatch.setattr(excitation, "_PAIRED", 1000)
    assert (nearest_distance(x), mean_distance(x)) == pytest.approx(exact, rel=0.03)
    assert nearest_distance(x) != exact[0]
