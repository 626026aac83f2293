import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.recording.grid import derivative, low_pass, uniform, windows

CUTS = st.lists(st.integers(1, 399), max_size=12, unique=True).map(sorted)


def signal(time):
    return np.stack([np.sin(2 * time), np.cos(3 * time)], 1)


def stamps(count=400, seed=0):
    rng = np.random.default_rng(seed)
    return np.arange(count) * 0.01 + rng.uniform(-0.003, 0.003, count)


def pieces(time, cuts=()):
    return zip(np.split(time, list(cuts)), np.split(signal(time), list(cuts)))


def joined(blocks):
    blocks = list(blocks)
    return np.concatenate([b.time for b in blocks]), np.concatenate([b.signals for b in blocks])


def test_the_grid_is_uniform_and_the_signal_the_same():
    time, resampled = joined(uniform(pieces(stamps()), 0.01, 0.1))
    np.testing.assert_allclose(np.diff(time), 0.01, atol=1e-12)
    np.testing.assert_allclose(resampled, signal(time), atol=5e-4)


@settings(max_examples=20, deadline=None)
@given(CUTS, st.integers(0, 20))
def test_neither_pieces_nor_duplicates_make_a_difference(cuts, duplicates):
    time = np.sort(np.concatenate([stamps(), stamps()[50 : 50 + duplicates]]))
    for a, b in zip(*(joined(uniform(pieces(*x), 0.01, 0.1)) for x in ((time, cuts), (stamps(),)))):
        np.testing.assert_allclose(a, b, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(CUTS, st.integers(10, 380))
def test_a_gap_is_not_crossed(cuts, at):
    time = stamps()
    time[at:] += 1.0
    blocks = list(uniform(pieces(time, cuts), 0.01, 0.1))
    assert {block.run for block in blocks} == {0, 1}
    resampled, _ = joined(blocks)
    assert not ((resampled > time[at - 1] + 1e-9) & (resampled < time[at] - 1e-9)).any()
    for run in (0, 1):
        index = np.concatenate([b.first + np.arange(len(b.time)) for b in blocks if b.run == run])
        assert (index == np.arange(len(index))).all()


@settings(max_examples=20, deadline=None)
@given(CUTS, st.integers(1, 60), st.integers(1, 200))
def test_windows_give_every_point_once_with_its_neighbours(cuts, halo, least):
    time = stamps()
    time[200:] += 1.0
    blocks = list(uniform(pieces(time, cuts), 0.01, 0.1))
    whole, _ = joined(blocks)
    given_ = list(windows(blocks, halo, least))
    np.testing.assert_array_equal(np.concatenate([w.time[core] for w, core, _ in given_]), whole)
    assert sum(last for *_, last in given_) == 2
    for window, core, last in given_:
        before = core.start
        assert (before == 0 and window.first == 0) or before >= min(halo, window.first + before)
        assert last or len(window.time) - core.stop >= halo


def test_the_low_pass_keeps_slow_signals_in_place():
    time = np.arange(2000) * 0.01
    slow, fast = np.sin(2 * np.pi * 0.3 * time)[:, None], np.sin(2 * np.pi * 20 * time)[:, None]
    resampled = low_pass(slow + fast, 5.0, 0.01, 4)[200:-200]
    np.testing.assert_allclose(resampled, slow[200:-200], atol=1e-4)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_derivatives_of_polynomials_are_exact_inside(power):
    time, inside = np.arange(50)[:, None] * 0.1, slice(2, -2)
    expected = power * time ** (power - 1)
    np.testing.assert_allclose(derivative(time**power, 0.1)[inside], expected[inside], atol=1e-10)
