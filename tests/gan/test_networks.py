import pytest
import torch

from sidegan.gan.networks import Generator


def images_of(count, shape, rank=None):
    random, size = torch.Generator().manual_seed(3), shape[0] * shape[1] * shape[2]
    mixing = torch.randn(size, rank or size, generator=random, dtype=torch.float64)
    x = torch.randn(count, rank or size, generator=random, dtype=torch.float64)
    return (x @ mixing.T + torch.linspace(-2, 2, size)).view(count, *shape)


@pytest.mark.parametrize(("noise", "rank"), [(30, None), (4, 4)])
def test_a_gaussian_start_has_mean_and_covariance_of_the_images(noise, rank):
    torch.manual_seed(0)
    images = images_of(400, (2, 2, 3), rank)
    network = Generator(2, 3, noise, width=32, shortcut=True)
    network.start_from(images)
    with torch.no_grad():
        z = network.draw(100_000)
        linear, layers = network.shortcut(z).double(), network.layers(z).flatten(1)
        torch.testing.assert_close(network(z).flatten(1), network.shortcut(z) + layers)
    x = images.flatten(1)
    torch.testing.assert_close((linear + layers).mean(0), x.mean(0), rtol=0, atol=0.05)
    expected = torch.cov(x.T)
    assert (torch.cov(linear.T) - expected).norm() < 0.02 * expected.norm()
    assert 0 < layers.std(0).mean() < 0.2  # the layers are there, but whisper
