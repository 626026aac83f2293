"""Modified Fourier trajectories: Park's formula as the oracle, rest and linearity as the laws."""

from collections.abc import Sequence

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Motion, Trajectory, concatenate
from sidegan.validity.bounds import jerk_bound

FAMILIES = [(1.0, 1), (1.0, 210), (4.0, 3), (16.0, 6), (37.3, 11), (560.0, 6), (560.0, 210)]


def coefficients(trajectory: Trajectory, batch: int = 3, seed: int = 0) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(batch, *trajectory.shape, generator=generator, dtype=torch.float64)


@st.composite
def families(draw: st.DrawFn) -> Trajectory:
    joints = draw(st.integers(1, 4))
    home = draw(st.lists(st.floats(-3, 3), min_size=joints, max_size=joints))
    return Trajectory(joints, draw(st.integers(1, 210)), draw(st.floats(1.0, 560.0)), home)


def park(trajectory: Trajectory, c: Tensor, t: np.ndarray) -> np.ndarray:
    """Joint position from the formula as printed, the quintic solved for in extended precision."""
    period = np.longdouble(trajectory.period)
    s = t.astype(np.longdouble) / period
    k = np.arange(1, trajectory.harmonics + 1, dtype=np.longdouble)
    w = 2 * np.longdouble(np.pi) / period * k
    a, b = np.moveaxis(c.numpy().astype(np.longdouble), -1, 0)
    turns = 2 * np.longdouble(np.pi) * np.outer(s, k)
    waves = np.einsum("tk,bjk->btj", np.sin(turns) / w, a) - np.einsum("tk,bjk->btj", np.cos(turns) / w, b)
    powers = np.vander([0.0, 1.0], 6, increasing=True)
    slopes = np.array([[0, 1, 0, 0, 0, 0], [0, 1, 2, 3, 4, 5]], float)
    bends = np.array([[0, 0, 2, 0, 0, 0], [0, 0, 2, 6, 12, 20]], float)
    start = np.stack([-(b / w).sum(-1), period * a.sum(-1), period**2 * (b * w).sum(-1)])
    target = np.repeat(start, 2, axis=0).astype(float)  # both ends alike
    solved = np.linalg.solve(np.concatenate([powers, slopes, bends]), -target.reshape(6, -1)).reshape(
        target.shape
    )
    return (
        waves + np.einsum("ti,ibj->btj", np.vander(s, 6, increasing=True), solved) + np.array(trajectory.home)
    )


@pytest.mark.parametrize(("period", "harmonics"), FAMILIES)
def test_position_is_that_of_parks_formula(period: float, harmonics: int) -> None:
    trajectory = Trajectory(2, harmonics, period, home=(0.3, -1.0))
    c = coefficients(trajectory)
    times = trajectory.times(200 / period)
    position = trajectory.roll_out(c, times).position.numpy()
    np.testing.assert_allclose(position, park(trajectory, c, times.numpy()), atol=1e-11 * max(1.0, period))


@settings(max_examples=60, deadline=None)
@given(families(), st.integers(0, 1000))
def test_rests_at_home_at_both_ends(trajectory: Trajectory, seed: int) -> None:
    motion = trajectory.roll_out(
        coefficients(trajectory, seed=seed), trajectory.times(50 / trajectory.period)
    )
    ends = [0, -1]
    home = torch.tensor(trajectory.home, dtype=torch.float64)
    torch.testing.assert_close(motion.position[:, ends], home.expand(3, 2, -1), atol=1e-12, rtol=0)
    assert motion.velocity[:, ends].abs().max() <= 1e-12
    assert motion.acceleration[:, ends].abs().max() <= 1e-12


@pytest.mark.parametrize(("period", "harmonics"), FAMILIES)
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_each_derivative_is_the_slope_of_the_one_before(period: float, harmonics: int, order: int) -> None:
    trajectory = Trajectory(2, harmonics, period)
    c = coefficients(trajectory)
    step = 1e-4 * period / harmonics
    times = torch.linspace(step, period - step, 101, dtype=torch.float64)
    before, after = (trajectory.derivative(c, times + h, order) for h in (-step, step))
    slope = trajectory.derivative(c, times, order + 1)
    torch.testing.assert_close(
        (after - before) / (2 * step), slope, rtol=0, atol=1e-6 * float(slope.abs().max())
    )


def test_motion_is_linear_in_the_coefficients() -> None:
    trajectory = Trajectory(3, 5, 12.0, home=(1.0, 0.0, -2.0))
    times = trajectory.times(20)
    one, two = coefficients(trajectory, seed=1), coefficients(trajectory, seed=2)
    mixed, first, second = (trajectory.roll_out(c, times) for c in (2 * one - 3 * two, one, two))
    home = torch.tensor(trajectory.home)
    excursion = 2 * (first.position - home) - 3 * (second.position - home)
    torch.testing.assert_close(mixed.position - home, excursion)
    torch.testing.assert_close(mixed.velocity, 2 * first.velocity - 3 * second.velocity)
    torch.testing.assert_close(mixed.acceleration, 2 * first.acceleration - 3 * second.acceleration)


def test_gradient_follows_from_linearity() -> None:
    trajectory = Trajectory(2, 3, 5.0)
    c = coefficients(trajectory).requires_grad_(True)
    times = trajectory.times(7)
    assert torch.autograd.gradcheck(lambda x: tuple(trajectory.roll_out(x, times)[1:]), (c,))


@pytest.mark.parametrize("rate", [5, 20, 60, 1000])
def test_roll_outs_at_different_rates_agree_where_they_meet(rate: int) -> None:
    trajectory = Trajectory(2, 6, 16.0)
    c = coefficients(trajectory)
    slow, fast = trajectory.roll_out(c, trajectory.times(5)), trajectory.roll_out(c, trajectory.times(rate))
    assert len(fast.time) == 16 * rate + 1
    for x, y in zip(slow[1:], fast[1:]):
        torch.testing.assert_close(x, y[:, :: rate // 5], atol=1e-12, rtol=0)


def test_rate_is_the_nearest_that_fills_the_period() -> None:
    times = Trajectory(1, 1, 2.5).times(3)
    assert len(times) == 9 and times[0] == 0 and times[-1] == 2.5
    torch.testing.assert_close(times.diff(), torch.full((8,), 2.5 / 8, dtype=torch.float64))


def test_grid_holds_the_centres_of_equal_cells() -> None:
    assert Trajectory(1, 1, 8.0).grid(4).tolist() == [1.0, 3.0, 5.0, 7.0]


def test_concatenation_is_one_smooth_motion() -> None:
    trajectory = Trajectory(2, 4, 6.0, home=(0.5, -0.5))
    motion = trajectory.roll_out(coefficients(trajectory, batch=5), trajectory.times(100))
    long = concatenate(motion)
    assert long.position.shape == (1, 5 * 600 + 1, 2)
    torch.testing.assert_close(long.time, torch.arange(3001, dtype=torch.float64) / 100)
    joints = torch.arange(0, 3001, 600)  # where one ends and the next begins
    torch.testing.assert_close(
        long.position[0, joints], torch.tensor([[0.5, -0.5]], dtype=torch.float64).expand(6, 2)
    )
    assert long.velocity[0, joints].abs().max() < 1e-12 and long.acceleration[0, joints].abs().max() < 1e-12
    for i in range(5):
        torch.testing.assert_close(long.position[0, 600 * i : 600 * i + 601], motion.position[i])
    drift = torch.cumulative_trapezoid(long.velocity, long.time, dim=1) + long.position[:, :1]
    torch.testing.assert_close(drift, long.position[:, 1:], atol=1e-3, rtol=0)


@settings(max_examples=40, deadline=None)
@given(st.floats(1.0, 560.0), st.integers(1, 40), st.integers(2, 400), st.integers(0, 1000))
def test_jerk_and_snap_never_exceed_their_bounds(
    period: float, harmonics: int, cells: int, seed: int
) -> None:
    trajectory = Trajectory(2, harmonics, period)
    c = coefficients(trajectory, seed=seed)
    times = torch.linspace(0, period, 4001, dtype=torch.float64)
    jerk, basis = trajectory.derivative(c, times, 3), trajectory.basis(times, 4)
    allowed = 1 + 1e-9  # rounding
    assert (basis.abs().amax(0) <= trajectory.snap_bound() * allowed).all()
    assert (jerk.abs().amax(1) <= jerk_bound(trajectory, c, cells) * allowed).all()


def test_jerk_bound_is_close_on_a_fine_grid() -> None:
    trajectory = Trajectory(7)
    c = coefficients(trajectory, batch=20)
    peak = trajectory.derivative(c, trajectory.times(500), 3).abs().amax(1)
    assert (jerk_bound(trajectory, c, 1600) < 1.1 * peak).all()


def test_writing_to_a_basis_changes_no_other() -> None:
    trajectory = Trajectory(1, 2, 3.0)
    times = trajectory.grid(5)
    trajectory.basis(times, 0).zero_()
    assert trajectory.basis(times, 0).abs().max() > 0


def test_large_bases_are_the_same_as_kept_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    trajectory = Trajectory(1, 2, 3.0)
    times = trajectory.grid(5)
    kept = trajectory.basis(times, 1)
    monkeypatch.setattr("sidegan.motion.trajectory._CACHED", 1)
    torch.testing.assert_close(trajectory.basis(times, 1), kept, atol=0, rtol=0)


@pytest.mark.parametrize("kept", [1, 4, 5])  # no, one or two time points of two harmonics, of five
def test_motion_does_not_depend_on_how_much_of_a_basis_is_kept(
    kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    trajectory = Trajectory(3, 2, 3.0, home=(0.1, 0.2, 0.3))
    c, times = coefficients(trajectory), trajectory.grid(5)
    at_once = trajectory.roll_out(c, times)
    monkeypatch.setattr("sidegan.motion.trajectory._CACHED", kept)
    for one, other in zip(trajectory.roll_out(c, times), at_once):
        torch.testing.assert_close(one, other, atol=1e-12, rtol=0)


def test_description_makes_the_same_family() -> None:
    trajectory = Trajectory(3, 4, 5.0, home=np.array([0.1, 0.2, 0.3]))
    assert Trajectory(**trajectory.describe()) == trajectory
    assert trajectory.describe() == {"joints": 3, "harmonics": 4, "period": 5.0, "home": [0.1, 0.2, 0.3]}


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_motion_follows_type_and_device_of_the_coefficients(dtype: torch.dtype, device: torch.device) -> None:
    trajectory = Trajectory(2, 6, 5.3, home=(0.1, 0.2))
    c = coefficients(trajectory)
    exact = trajectory.roll_out(c, trajectory.times(50))
    motion = trajectory.roll_out(c.to(device, dtype), trajectory.times(50))
    assert all(x.dtype == dtype and x.device.type == device.type for x in motion)
    for x, y in zip(motion, exact):
        torch.testing.assert_close(
            x.cpu().double(), y, rtol=0, atol=1e-5 if dtype == torch.float32 else 1e-12
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"joints": 0}, "joints and harmonics must be positive, got 0"),
        ({"joints": 2, "harmonics": 0}, "got 2 and 0"),
        ({"joints": 2, "period": 0.0}, "period must be a positive number of seconds, got 0.0"),
        ({"joints": 2, "period": float("nan")}, "got nan"),
        ({"joints": 2, "period": float("inf")}, "got inf"),
        ({"joints": 2, "home": [0.0]}, "must be 2 finite joint positions"),
        ({"joints": 2, "home": [0.0, float("nan")]}, "nan"),
    ],
)
def test_impossible_families_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        Trajectory(**arguments)


@pytest.mark.parametrize("shape", [(2, 6, 2), (1, 3, 6, 2), (1, 2, 5, 2), (1, 2, 6, 1), (1, 1, 2, 6, 2)])
def test_coefficients_of_the_wrong_shape_are_refused(shape: Sequence[int]) -> None:
    trajectory = Trajectory(2)
    for use in (trajectory.check, lambda c: trajectory.roll_out(c, trajectory.grid(3))):
        with pytest.raises(ShapeError, match=r"expected \(B, 2, 6, 2\)"):
            use(torch.zeros(shape))


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
def test_coefficients_that_are_not_finite_are_refused(bad: float) -> None:
    trajectory = Trajectory(2)
    c = torch.zeros(4, *trajectory.shape)
    c[2, 0, 1, 1] = bad
    for use in (trajectory.check, lambda c: trajectory.roll_out(c, trajectory.grid(3))):
        with pytest.raises(ShapeError, match="trajectory 2 are not finite"):
            use(c)


@pytest.mark.parametrize("rate", [0.0, -1.0, 0.01, float("nan"), float("inf")])
def test_rates_without_a_sample_are_refused(rate: float) -> None:
    with pytest.raises(ShapeError, match=r"gives no sample in 16\.0 s"):
        Trajectory(1).times(rate)


def test_empty_grids_are_refused() -> None:
    with pytest.raises(ShapeError, match="at least one sample, got 0"):
        Trajectory(1).grid(0)


@pytest.mark.parametrize("time", [-0.1, 16.1, float("nan")])
def test_times_outside_the_period_are_refused(time: float) -> None:
    trajectory = Trajectory(1)
    with pytest.raises(ShapeError, match=r"expected 0 to 16.0 s"):
        trajectory.roll_out(coefficients(trajectory), torch.tensor([1.0, time]))


def test_motions_that_do_not_meet_at_rest_are_refused() -> None:
    trajectory = Trajectory(2)
    c = coefficients(trajectory)
    whole = trajectory.roll_out(c, trajectory.times(20))
    apart = whole._replace(position=whole.position + torch.arange(3)[:, None, None])
    for motion in (trajectory.roll_out(c, trajectory.grid(10)), apart):
        with pytest.raises(ShapeError, match="begin and end at rest at one position"):
            concatenate(motion)


def test_nothing_to_concatenate_is_refused() -> None:
    trajectory = Trajectory(2)
    empty = trajectory.roll_out(coefficients(trajectory, batch=0), trajectory.times(1))
    single = trajectory.roll_out(coefficients(trajectory), torch.zeros(1))
    for motion in (empty, single):
        with pytest.raises(ShapeError, match="two samples or more"):
            concatenate(Motion(*motion))
