import pytest
import torch
from torch import nn

from sidegan.errors import ConfigError
from sidegan.gan import dcgan
from sidegan.gan.networks import Generator

SIZES = [(1, 1), (1, 4), (2, 3), (7, 6), (3, 5), (9, 2)]
NORMS = (nn.BatchNorm1d, nn.BatchNorm2d)


def convolutions(network):
    return [one for one in network if isinstance(one, (nn.Conv2d, nn.ConvTranspose2d, nn.Linear))]


def follower(network, layer):
    """What comes right after a layer."""
    layers = list(network)
    return layers[layers.index(layer) + 1]


@pytest.mark.parametrize(("joints", "harmonics"), SIZES)
def test_images_and_logits_have_their_shapes(joints, harmonics):
    torch.manual_seed(0)
    generator = dcgan.generator_layers(joints, harmonics, 20, 16)
    images = generator(torch.randn(5, 20))
    assert images.shape == (5, 2, joints, harmonics)
    assert dcgan.image_critic(joints, harmonics, 16)(images).shape == (5,)
    assert dcgan.feature_critic(3, 16)(torch.randn(5, 3)).shape == (5,)


def test_each_network_has_four_layers_whose_strides_double_the_image():
    generator, critic = dcgan.generator_layers(7, 6, 100, 256), dcgan.image_critic(7, 6, 256)
    up, down = convolutions(generator), convolutions(critic)
    assert all(isinstance(one, nn.ConvTranspose2d) for one in up)
    assert all(isinstance(one, nn.Conv2d) for one in down)
    assert [one.stride[0] for one in up] == [1, 2, 2, 2] and [one.stride[0] for one in down] == [2, 2, 2, 1]
    assert [one.out_channels for one in up] == [256, 128, 64, 2]
    assert [one.out_channels for one in down] == [64, 128, 256, 1]
    assert len(convolutions(dcgan.feature_critic(43, 256))) == 4
    assert isinstance(generator[-1], nn.Tanh)


def test_batch_normalisation_is_everywhere_but_at_the_ends():
    generator, critic = dcgan.generator_layers(7, 6, 100, 32), dcgan.image_critic(7, 6, 32)
    normed = [isinstance(follower(generator, one), NORMS) for one in convolutions(generator)]
    assert normed == [True, True, True, False]
    for network in (critic, dcgan.feature_critic(5, 32)):
        normed = [isinstance(follower(network, one), NORMS) for one in convolutions(network)]
        assert normed == [False, True, True, False]


def test_activations_are_relu_up_and_leaky_relu_down():
    generator, critic = dcgan.generator_layers(7, 6, 100, 32), dcgan.image_critic(7, 6, 32)
    assert sum(isinstance(one, nn.ReLU) for one in generator) == 3
    assert [one.negative_slope for one in critic if isinstance(one, nn.LeakyReLU)] == [0.2] * 3


@pytest.mark.parametrize(
    "network", [dcgan.generator_layers(7, 6, 100, 256), dcgan.image_critic(7, 6, 256)], ids=["up", "down"]
)
def test_weights_are_drawn_with_a_deviation_of_two_hundredths(network):
    weights = torch.cat([one.weight.flatten() for one in convolutions(network)]).detach()
    assert float(weights.mean()) == pytest.approx(0, abs=1e-3)
    assert float(weights.std()) == pytest.approx(0.02, rel=0.02)
    gains = torch.cat([one.weight for one in network if isinstance(one, NORMS)]).detach()
    assert float(gains.mean()) == pytest.approx(1, abs=0.01)
    assert float(gains.std()) == pytest.approx(0.02, rel=0.2)
    assert all((one.bias == 0).all() for one in network if getattr(one, "bias", None) is not None)


def test_a_generator_stays_within_tanh_and_does_not_depend_on_its_batch_when_trained():
    torch.manual_seed(0)
    network = Generator(7, 6, 100, "dcgan", 32)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter *= 30
        assert network(network.draw(50)).abs().max() <= 1
        z = network.draw(50)
        assert (network(z)[:5] - network(z[:5])).abs().max() > 0.1
        network.eval()
        torch.testing.assert_close(network(z)[:5], network(z[:5]), rtol=0, atol=1e-3)


@pytest.mark.parametrize("settings", [{"shortcut": True}, {"activation": "silu"}])
def test_what_a_dcgan_has_not_is_refused(settings):
    with pytest.raises(ConfigError, match="no shortcut, and ReLU"):
        Generator(2, 3, body="dcgan", width=8, **settings)
