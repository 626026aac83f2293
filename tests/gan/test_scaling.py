import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sidegan.errors import ShapeError
from sidegan.gan.scaling import Scaling


def correlated(count, joints, harmonics, seed):
    """Coefficients whose elements have different means, sizes and correlations."""
    random = torch.Generator().manual_seed(seed)
    size = 2 * harmonics
    mixing = torch.randn(joints, size, size, generator=random, dtype=torch.float64)
    mixing += 2 * torch.eye(size)
    x = torch.randn(count, joints, size, generator=random, dtype=torch.float64)
    c = torch.einsum("njk,jlk->njl", x, mixing) + torch.randn(joints, size, generator=random)
    return c.view(count, joints, harmonics, 2)


@given(
    kind=st.sampled_from(["joint", "range"]),
    count=st.integers(2, 20),
    joints=st.integers(1, 4),
    harmonics=st.integers(1, 5),
    seed=st.integers(0, 1000),
)
def test_images_and_coefficients_are_each_others_inverse(kind, count, joints, harmonics, seed):
    c = correlated(count, joints, harmonics, seed)
    scaling = Scaling.fit(c, kind)
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


def test_range_divides_each_element_by_its_largest_absolute_value():
    c = correlated(50, 2, 3, 1)
    image = Scaling.fit(c, "range").image(c)
    expected = (c / c.abs().amax(0)).permute(0, 3, 1, 2)
    torch.testing.assert_close(image, expected)


def test_seeds_that_span_less_than_their_space_can_be_scaled():
    c = correlated(3, 2, 6, 2)
    scaling = Scaling.fit(c)
    assert torch.isfinite(scaling.image(torch.randn_like(c))).all()


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_seeds_are_refused(count):
    with pytest.raises(ShapeError, match=f"two seeds, got {count}"):
        Scaling.fit(torch.zeros(count, 2, 3, 2))


def test_an_unknown_kind_is_refused():
    with pytest.raises(ShapeError, match="'log' must be 'joint' or 'range'"):
        Scaling.fit(torch.zeros(3, 2, 3, 2), "log")
