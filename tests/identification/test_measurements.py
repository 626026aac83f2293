import numpy as np
import pytest

from sidegan.identification import Noise, disturbed, measure
from sidegan.motion.trajectory import Trajectory


def stack(measurements):
    return np.stack([*measurements.states, measurements.torque])


@pytest.fixture(scope="module")
def motion():
    """Two trajectories of 150 samples, (2, 150, 2)."""
    family = Trajectory(2, 3, 3.0)
    c = np.random.default_rng(7).normal(size=(2, *family.shape))
    return family.roll_out(c, family.times(149 / 3))


def test_noise_is_uniform_relative_to_the_signal(body, motion):
    exact = measure(body, motion)
    clean = stack(exact)
    added = stack(disturbed(exact, Noise(state=True), np.random.default_rng(1))) - clean
    moving = clean != 0  # at rest there is none
    share = added[moving] / clean[moving]
    assert 0.0995 < np.abs(share).max() <= 0.1 + 1e-9
    # U(−0.1, 0.1) has mean 0 and standard deviation 0.1 / √3: 2400 draws, five standard errors.
    assert abs(share.mean()) < 5 * 0.1 / np.sqrt(3 * 2400)
    assert share.std() == pytest.approx(0.1 / np.sqrt(3), rel=0.05)


def test_the_noise_of_a_signal_does_not_depend_on_other_signals(body, motion):
    clean = measure(body, motion)
    assert all(np.array_equal(x, true.reshape(300, 2)) for x, true in zip(clean.states, motion[1:]))
    torque, state, both = (
        disturbed(clean, Noise(torque=noisy[0], state=noisy[1]), np.random.default_rng(1))
        for noisy in ((True, False), (False, True), (True, True))
    )
    assert all(np.array_equal(x, y) for x, y in zip(torque.states, clean.states))
    assert np.array_equal(state.torque, clean.torque)  # the torque of the true states
    assert np.array_equal(both.torque, torque.torque)
    assert all(np.array_equal(x, y) for x, y in zip(both.states, state.states))
    assert not np.array_equal(both.position, clean.position)


def test_a_batch_is_measured_like_its_trajectories_in_turn(body, motion):
    exact, noise, random = measure(body, motion), Noise(state=True), np.random.default_rng(5)
    whole = stack(disturbed(exact, noise, np.random.default_rng(5), batch=2))
    parts = [stack(disturbed(part, noise, random)) for part in (exact[:150], exact[150:])]
    np.testing.assert_array_equal(whole, np.concatenate(parts, 1))
