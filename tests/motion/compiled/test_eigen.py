"""Compiled eigenpairs at both ends of a spectrum against LAPACK."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.motion.backend import extremes

pytest.importorskip("numba")


def symmetric(spectrum, seed):
    size = len(spectrum)
    generator = torch.Generator().manual_seed(seed)
    turn = torch.linalg.qr(torch.randn(size, size, generator=generator, dtype=torch.float64))[0]
    x = (turn * torch.tensor(spectrum, dtype=torch.float64)) @ turn.T
    return (x + x.T)[None] / 2


def check(x, low=3, high=2):
    """Values are LAPACK's; the vectors are eigenvectors, of length one and at right angles."""
    values, vectors = extremes(x, low, high)
    expected = torch.linalg.eigvalsh(x)
    size = x.shape[1]
    if size > low + high:
        expected = expected[:, [*range(low), *range(size - high, size)]]
    scale = max(float(x.abs().max()), 1e-300)
    torch.testing.assert_close(values / scale, expected / scale, rtol=0, atol=1e-14 * size)
    residue = (x / scale) @ vectors - vectors * (values / scale)[:, None]
    assert residue.abs().max() < 1e-13 * size
    eye = torch.eye(vectors.shape[2], dtype=x.dtype).expand(len(x), -1, -1)
    torch.testing.assert_close(vectors.mT @ vectors, eye, rtol=0, atol=1e-8)


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=45), st.integers(0, 100))
def test_ends_of_a_spectrum_are_lapacks(spectrum, seed):
    check(symmetric(spectrum, seed))


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 45), st.integers(1, 12), st.integers(0, 100))
def test_spectra_over_many_orders_of_magnitude(size, orders, seed):
    check(symmetric([10.0 ** (-orders * k / size) for k in range(size)], seed))


@pytest.mark.parametrize("spectrum", [[0.0] * 9, [1.0] * 9, [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0]])
def test_equal_eigenvalues_get_vectors_at_right_angles(spectrum):
    check(symmetric(spectrum, 0))


def test_nothing_is_done_again_where_eigenvalues_are_well_apart(monkeypatch):
    """That is what makes it fast: what is not accurate enough is left to LAPACK."""
    monkeypatch.setattr("sidegan.motion.plain.extremes", None)
    check(torch.cat([symmetric(range(30), seed) for seed in range(20)]))


def test_nothing_is_done_again_where_an_eigenvector_is_a_column_of_the_identity(monkeypatch):
    """Whichever of them it is: each eigenvalue at the ends has been in each place."""
    monkeypatch.setattr("sidegan.motion.plain.extremes", None)
    check(torch.stack([torch.arange(9.0).double().roll(k).diag() for k in range(9)]))


@pytest.mark.parametrize(
    "x",
    [
        torch.diag(torch.arange(9.0, dtype=torch.float64))[None],
        torch.zeros(2, 8, 8, dtype=torch.float64),
        1e150 * symmetric(range(1, 10), 1),
        1e-150 * symmetric(range(1, 10), 1),
        torch.zeros(0, 8, 8, dtype=torch.float64),
    ],
)
def test_special_matrices(x):
    if len(x):
        check(x)
    else:
        assert extremes(x, 3, 2)[1].shape == (0, 8, 5)


def test_threads_change_nothing():
    x = torch.cat([symmetric([*range(20)], seed) for seed in range(120)])
    one = extremes(x, 3, 2)
    torch.set_num_threads(2)
    try:
        two = extremes(x, 3, 2)
    finally:
        torch.set_num_threads(1)
    for a, b in zip(one, two):
        torch.testing.assert_close(a, b, rtol=1e-12, atol=1e-12)


def test_both_engines_give_the_pairs_at_the_ends(engine):
    values, vectors = extremes(symmetric(range(1, 9), 3), 3, 2)
    expected = torch.tensor([[1.0, 2.0, 3.0, 7.0, 8.0]], dtype=torch.float64)
    torch.testing.assert_close(values, expected)
    assert vectors.shape == (1, 8, 5)
