import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.errors import ShapeError
from sidegan.gan.limits import LimitLayer
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints, check

ARM = load_robot("planar2")
LIMITED = ("position", "velocity")


def draw(family, seed, scale, count=8):
    return scale * torch.randn(count, *family.shape, generator=torch.Generator().manual_seed(seed))


@settings(deadline=None, max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    scale=st.floats(-4, 4),
    period=st.floats(1, 60),
    home=st.floats(-1.5, 1.5),
    harmonics=st.integers(1, 8),
)
def test_whatever_comes_in_position_and_velocity_limits_hold_all_the_time(
    seed, scale, period, home, harmonics
):
    family = Trajectory(2, harmonics, period, (home, -home))
    c = LimitLayer.of(ARM, family)(draw(family, seed, 10**scale)).double()
    margins = check(Constraints(ARM), family, c).margins
    assert all((margins[name] >= 0).all() for name in LIMITED)


def test_much_is_used_of_the_limits_and_small_motions_are_left_alone():
    family = Trajectory(2, 4, 8.0)
    limits = LimitLayer.of(ARM, family)
    large, small = draw(family, 0, 100.0), draw(family, 0, 1e-3)
    used = limits.use(limits(large))
    assert (used <= 1).all() and (used > 0.999).all()
    torch.testing.assert_close(limits(small), small, rtol=1e-4, atol=0)


def test_what_is_used_grows_with_the_coefficients_and_bounds_what_is_sampled():
    family = Trajectory(2, 4, 8.0, (0.3, -0.4))
    limits, c = LimitLayer.of(ARM, family), draw(family, 1, 0.3)
    torch.testing.assert_close(limits.use(2.5 * c), 2.5 * limits.use(c), rtol=1e-4, atol=1e-6)
    motion = family.roll_out(c.double(), family.times(500))
    speed = (motion.velocity.abs() / ARM.velocity_limit).amax(1)
    assert (limits.use(c) >= speed - 1e-5).all()


def test_the_slope_is_finite_at_rest_and_far_out():
    family = Trajectory(2, 4, 8.0)
    c = torch.cat([draw(family, 0, 0.0, 2), draw(family, 0, 1e6, 2)]).requires_grad_(True)
    (slope,) = torch.autograd.grad(LimitLayer.of(ARM, family)(c).square().sum(), c)
    assert torch.isfinite(slope).all()


def test_limits_of_another_shape_are_refused():
    family = Trajectory(2, 4, 8.0)
    with pytest.raises(ShapeError, match="3 joints for an arm of 2"):
        LimitLayer.of(ARM, Trajectory(3, 4, 8.0))
    with pytest.raises(ShapeError, match=r"room \(2, 3\) and speed \(2,\)"):
        LimitLayer(family, torch.ones(2, 3), torch.ones(2))
    with pytest.raises(ShapeError, match="positive"):
        LimitLayer(family, torch.zeros(2, 2), torch.ones(2))
