import torch
from hypothesis import given
from hypothesis import strategies as st

from sidegan.gan.scaling import Scaling
from tests.gan.conftest import random


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
