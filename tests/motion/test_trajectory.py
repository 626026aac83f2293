"""Modified Fourier trajectories: Park's formula as the oracle, rest and linearity as the laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid

from sidegan.motion.trajectory import Trajectory, concatenate
from sidegan.validity.search import jerk_bound
from tests.motion.conftest import close, normal

HOMES = st.tuples(st.floats(-3, 3), st.floats(-3, 3))
ANY = st.builds(Trajectory, st.just(2), st.integers(1, 210), st.floats(1.0, 560.0), HOMES)
FAMILIES = [(1.0, 1), (1.0, 210), (4.0, 3), (16.0, 6), (37.3, 11), (560.0, 6), (560.0, 210)]


def park(trajectory, c, t):
    """Joint position from the formula as printed, the quintic solved for in extended precision."""
    period = np.longdouble(trajectory.period)
    s = t.astype(np.longdouble) / period
    k = np.arange(1, trajectory.harmonics + 1, dtype=np.longdouble)
    w = 2 * np.longdouble(np.pi) / period * k
    a, b = np.moveaxis(c.astype(np.longdouble), -1, 0)
    turns = 2 * np.longdouble(np.pi) * np.outer(s, k)
    waves = np.einsum("tk,bjk->btj", np.sin(turns) / w, a) - np.einsum("tk,bjk->btj", np.cos(turns) / w, b)
    powers = np.vander([0.0, 1.0], 6, increasing=True)
    slopes = np.array([[0, 1, 0, 0, 0, 0], [0, 1, 2, 3, 4, 5]], float)
    bends = np.array([[0, 0, 2, 0, 0, 0], [0, 0, 2, 6, 12, 20]], float)
    start = np.stack([-(b / w).sum(-1), period * a.sum(-1), period**2 * (b * w).sum(-1)])
    target = np.repeat(start, 2, axis=0).astype(float)  # both ends alike
    solved = np.linalg.solve(np.concatenate([powers, slopes, bends]), -target.reshape(6, -1))
    quintic = np.einsum("ti,ibj->btj", np.vander(s, 6, increasing=True), solved.reshape(target.shape))
    return waves + quintic + np.array(trajectory.home)


@pytest.mark.parametrize(("period", "harmonics"), FAMILIES)
def test_position_is_that_of_parks_formula(period, harmonics):
    trajectory = Trajectory(2, harmonics, period, home=(0.3, -1.0))
    c = normal(3, *trajectory.shape)
    times = trajectory.times(200 / period)
    position = trajectory.roll_out(c, times).position
    np.testing.assert_allclose(position, park(trajectory, c, times), atol=1e-11 * max(1.0, period))


@settings(max_examples=60)
@given(ANY, st.integers(0, 1000))
def test_trajectories_rest_at_home_at_both_ends(trajectory, seed):
    c, ends = normal(3, *trajectory.shape, seed=seed), [0, -1]
    motion = trajectory.roll_out(c, trajectory.times(50 / trajectory.period))
    np.testing.assert_allclose(motion.position[:, ends] - trajectory.home, 0, atol=1e-12)
    assert np.abs(motion.velocity[:, ends]).max() <= 1e-12
    assert np.abs(motion.acceleration[:, ends]).max() <= 1e-12


@pytest.mark.parametrize(("period", "harmonics"), FAMILIES)
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_each_derivative_is_the_slope_of_the_one_before(period, harmonics, order):
    trajectory = Trajectory(2, harmonics, period)
    c = normal(3, *trajectory.shape)
    step = 1e-4 * period / harmonics
    times = np.linspace(step, period - step, 101)
    before, after = (trajectory.derivative(c, times + h, order) for h in (-step, step))
    slope = trajectory.derivative(c, times, order + 1)
    close((after - before) / (2 * step), slope, 1e-6)


def test_concatenation_is_one_smooth_motion():
    trajectory = Trajectory(2, 4, 6.0, home=(0.5, -0.5))
    motion = trajectory.roll_out(normal(5, *trajectory.shape), trajectory.times(100))
    long = concatenate(motion)
    assert long.position.shape == (1, 5 * 600 + 1, 2)
    np.testing.assert_allclose(long.time, np.arange(3001) / 100, atol=1e-7)
    joints = np.arange(0, 3001, 600)  # where one ends and the next begins
    np.testing.assert_allclose(long.position[0, joints] - trajectory.home, 0, atol=1e-7)
    for x in (long.velocity, long.acceleration):
        assert np.abs(x[0, joints]).max() < 1e-12
    for i in range(5):
        np.testing.assert_allclose(long.position[0, 600 * i : 600 * i + 601], motion.position[i], atol=1e-7)
    drift = cumulative_trapezoid(long.velocity, long.time, axis=1) + long.position[:, :1]
    np.testing.assert_allclose(drift, long.position[:, 1:], atol=1e-3, rtol=0)


@settings(max_examples=40)
@given(st.floats(1.0, 560.0), st.integers(1, 40), st.integers(2, 400), st.integers(0, 1000))
def test_jerk_and_snap_never_exceed_their_bounds(period, harmonics, cells, seed):
    trajectory = Trajectory(2, harmonics, period)
    c = normal(3, *trajectory.shape, seed=seed)
    times = np.linspace(0, period, 4001)
    jerk, basis = trajectory.derivative(c, times, 3), trajectory.basis(times, 4)
    allowed = 1 + 1e-9  # rounding
    assert (np.abs(basis).max(0) <= trajectory.derivative_bound(4) * allowed).all()
    assert (np.abs(jerk).max(1) <= jerk_bound(trajectory, c, cells) * allowed).all()


@pytest.mark.parametrize("dtype", [int, np.float32])
def test_times_of_another_type_give_the_same_motion(dtype):
    trajectory, times = Trajectory(2, 3, 8.0), np.arange(8)
    exact = trajectory.basis(times.astype(float), 1)
    np.testing.assert_allclose(trajectory.basis(times.astype(dtype), 1), exact, rtol=0, atol=0)


def test_times_fill_the_period_and_grids_are_cell_centres():
    times = Trajectory(1, 1, 2.5).times(3)
    assert len(times) == 9 and times[0] == 0 and times[-1] == 2.5
    np.testing.assert_allclose(np.diff(times), 2.5 / 8)
    assert Trajectory(1, 1, 8.0).grid(4).tolist() == [1.0, 3.0, 5.0, 7.0]


def test_motion_does_not_depend_on_how_many_times_are_asked_for():
    """A basis of a million numbers or more is made in parts."""
    trajectory = Trajectory(2, 210, 560.0, home=(0.1, 0.2))
    c, times = normal(1, *trajectory.shape), trajectory.grid(6000)
    for whole, part in zip(trajectory.roll_out(c, times)[1:], trajectory.roll_out(c, times[4000:])[1:]):
        rounding = 1e-13 * np.abs(whole).max()
        np.testing.assert_allclose(whole[:, 4000:], part, atol=rounding, rtol=0)
