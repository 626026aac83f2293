"""Images and coefficients; last layers that keep the limits on motion and a box."""

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.gan.scaling import CoefficientBox, LimitLayer, Scaling
from sidegan.gan.tensors import numpy_array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER, load_robot
from sidegan.validity import Constraints, check
from tests.gan.conftest import normal, random
from tests.validity.critical import limited

ARM = load_robot("planar2")
BOTH = ["acceleration", "jerk"]


def correlated(count, joints, harmonics, seed):
    """Coefficients whose elements have different means, sizes and correlations."""
    source, size = random(seed), 2 * harmonics
    mixing = torch.randn(joints, size, size, generator=source, dtype=torch.float64) + 2 * torch.eye(size)
    x = torch.randn(count, joints, size, generator=source, dtype=torch.float64)
    c = torch.einsum("njk,jlk->njl", x, mixing) + torch.randn(joints, size, generator=source)
    return c.view(count, joints, harmonics, 2)


@given(st.integers(2, 20), st.integers(1, 4), st.integers(1, 5), st.integers(0, 1000))
def test_images_and_coefficients_are_inverse(count, joints, harmonics, seed):
    """Also of seeds that span less than their space."""
    c = correlated(count, joints, harmonics, seed)
    scaling = Scaling.fit(c)
    image = scaling.image(c)
    assert image.shape == (count, 2, joints, harmonics)
    torch.testing.assert_close(scaling.coefficients(image), c, rtol=1e-8, atol=1e-8)
    torch.testing.assert_close(scaling.image(scaling.coefficients(image)), image, rtol=1e-8, atol=1e-8)


def test_each_joint_is_whitened():
    c = correlated(2000, 3, 4, 0)
    images = Scaling.fit(c).image(c).permute(0, 2, 3, 1).flatten(2)  # (N, J, 2 H)
    for joint in range(3):
        torch.testing.assert_close(images[:, joint].mean(0), torch.zeros(8).double(), rtol=0, atol=1e-9)
        torch.testing.assert_close(torch.cov(images[:, joint].T), torch.eye(8).double(), rtol=0, atol=0.15)
        assert (torch.cov(images[:, joint].T).diagonal() <= 1 + 1e-9).all()


def hold(arm, family, c, names):
    margins = check(Constraints(arm, torque=False), family, c).margins
    return all((margins[name] >= 0).all() for name in ("position", "velocity", *names))


@settings(max_examples=40)
@given(
    names=st.sets(st.sampled_from(BOTH)),
    seed=st.integers(0, 10_000),
    scale=st.floats(-4, 4),
    share=st.floats(-3, 1),
    period=st.floats(1, 60),
    home=st.floats(-1.5, 1.5),
    harmonics=st.integers(1, 8),
)
def test_limits_hold_for_any_input(names, seed, scale, share, period, home, harmonics):
    family, arm = Trajectory(2, harmonics, period, (home, -home)), limited(ARM, sorted(names), 10**share)
    c = LimitLayer(arm, family)(normal(family, seed, 10**scale))
    assert hold(arm, family, numpy_array(c), names)


def test_the_tightest_limit_is_fully_used_and_small_motions_unchanged():
    family, arm = Trajectory(2, 4, 8.0), limited(ARM, BOTH, 0.05)
    layer = LimitLayer(arm, family)
    c, small = layer(normal(family, 0, 100.0)), normal(family, 0, 1e-4)
    torch.testing.assert_close(layer(small), small, rtol=1e-4, atol=0)
    used = layer.use(c)
    assert (used <= 1).all() and (used > 0.999).all()
    times = np.linspace(0, 8, 20_001)
    shares = [
        np.abs(family.derivative(numpy_array(c), times, DERIVATIVE_ORDER[name])).max(1) / limit
        for name, limit in arm.higher_limits.items()
    ]
    most = np.max(shares, 0)
    assert (most <= 1).all() and (most > 0.95).all()


def test_the_gradient_is_finite_at_rest_and_far_out():
    family = Trajectory(2, 4, 8.0)
    c = torch.cat([normal(family, 0, 0.0, 2), normal(family, 0, 1e6, 2)]).requires_grad_(True)
    (slope,) = torch.autograd.grad(LimitLayer(ARM, family)(c).square().sum(), c)
    assert torch.isfinite(slope).all()


@given(st.floats(1e-3, 10), st.floats(-4, 6), st.integers(0, 10_000))
def test_the_box_holds_for_any_input_and_is_inverted_inside(size, scale, seed):
    family, box = Trajectory(2, 4, 8.0), CoefficientBox(size)
    free = normal(family, seed, size * 10**scale)
    c = box(free)
    assert c.double().abs().max() <= size
    again = box(box.free(c))
    assert (again - c).abs().max() <= 0.031 * size  # what is nearly on the box moves a little into it
    within = c.abs() < 0.96 * size
    torch.testing.assert_close(again[within], c[within], rtol=1e-3, atol=1e-5 * size)
