"""Excitation and diversity: the full YᵀY and closed forms as oracles."""

import math

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from sidegan.base.arrays import flatten
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
    y = body.regressor(*trajectory.roll_out(c, trajectory.grid(80))[1:]).reshape(len(c), -1, 10 * arm.joints)
    gram, p = y.mT @ y / 80, body.parameters_count
    eigenvalues, diagonal = np.linalg.eigvalsh(gram), np.linalg.diagonal(gram)
    noise = 1e-13 * eigenvalues[:, -1:]
    assert (np.abs(eigenvalues[:, :-p]) <= noise).all()
    assert (np.abs(excitation.spectrum - eigenvalues[:, -p:]) <= noise + 1e-9 * eigenvalues[:, -p:]).all()
    np.testing.assert_allclose(excitation.spectrum.sum(1), diagonal.sum(1))
    np.testing.assert_allclose(excitation.diagonal, diagonal[:, body.base.columns])


def test_fitnesses_are_ratios_of_extremes():
    spectrum = np.array([[2.0, 3.0, 8.0], [1e-9, 1.0, 1.0]])
    diagonal = np.array([[5.0, 1.0, 2.0], [7.0, 3.5, 7.0]])
    excitation = Excitation(spectrum, diagonal)
    np.testing.assert_allclose(excitation.eigenvalue_fitness, [4.0, 1e9])
    assert excitation.diagonal_fitness.tolist() == [5.0, 2.0]
    for low in (0.0, -1e-18, 4e-16):  # an unexcited direction
        spectrum = np.array([[low, 0.5, 1.0]])
        assert Excitation(spectrum, spectrum).eigenvalue_fitness.item() == math.inf


@pytest.mark.parametrize(
    ("x", "mean", "nearest"),
    [
        (np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0], [3.0, 4.0]]), (2 * 3 + 2 * 4 + 2 * 5) / 6, 3.0),
        (np.eye(12).reshape(12, 2, 3, 2), math.sqrt(2), math.sqrt(2)),
        (np.array([[0.0], [10.0]] * 5), 10 * 25 / 45, 0.0),  # modes far apart
    ],
)
def test_distances_by_hand(x, mean, nearest):
    assert mean_distance(x) == pytest.approx(mean)
    assert nearest_distance(x) == pytest.approx(nearest)


@pytest.mark.parametrize(
    ("squares", "rank"),
    [([], 0.0), ([1], 1.0), ([1] * 7, 7.0), ([3, 1], 4 / 3**0.75)],  # exp of the entropy of ¾ and ¼
)
def test_effective_rank_by_hand(squares, rank):
    steps = np.diag(np.sqrt(squares + [0.0] * (9 - len(squares))))
    assert effective_rank(np.concatenate([steps, -steps]) + 100.0) == pytest.approx(rank)


def test_effective_rank_does_not_depend_on_scale_or_basis():
    generator = np.random.default_rng(0)
    x = generator.standard_normal((200, 6)) * np.arange(1, 7)
    turn = np.linalg.qr(generator.standard_normal((6, 6)))[0]
    assert effective_rank(1e-7 * x @ turn - 5.0) == pytest.approx(effective_rank(x), rel=1e-6)


def test_a_single_trajectory_has_nothing_to_differ_from():
    one = np.zeros((1, 2, 3, 2))
    assert excitation.diversity(one, Excitation(np.ones((1, 5)), np.ones((1, 8)))) == {}


def _rows(count):
    return np.random.default_rng(count).standard_normal((count, 2, 3, 2))


@pytest.mark.parametrize("held", [1, 7, 2000])
def test_blocks_change_no_bit_of_the_nearest_distance(held, monkeypatch):
    rows = flatten(_rows(933), 1)
    exact = cdist(rows, rows)
    np.fill_diagonal(exact, np.inf)
    monkeypatch.setattr(excitation, "_AT_ONCE", held)
    assert nearest_distance(rows).hex() == float(exact.min(1).mean()).hex()


def test_a_sample_of_a_large_set_tells_nearly_the_same(monkeypatch):
    x = _rows(3000)
    exact = nearest_distance(x), mean_distance(x)
    monkeypatch.setattr(excitation, "_EXACT", 2999)
    monkeypatch.setattr(excitation, "_PAIRED", 1000)
    assert (nearest_distance(x), mean_distance(x)) == pytest.approx(exact, rel=0.03)
    assert nearest_distance(x) != exact[0]
