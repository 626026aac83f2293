"""The variants as the paper's authors published them: convolutions of scrambled images, and their losses.

Written by the facts of the code that accompanies Jegorova et al. 2020 (``seeds.published.REPOSITORY``); where
that and the text differ, by the code. Differences are said beside what they change.
"""

import torch
from torch import Tensor, nn

from sidegan.errors import ConfigError
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.losses import Adversary, Batch, Factor, Loss, Value, from_epoch
from sidegan.gan.published_networks import IMAGE, ConvolutionalDiscriminator, ConvolutionalGenerator
from sidegan.gan.settings import Variant
from sidegan.gan.side_gan import Data, SideGAN
from sidegan.seeds.published import Layout

_GROWTH = 0.06  # of the weight of success, per epoch from that on in which fitness counts
_TINY = 1e-12


class PublishedVanilla(SideGAN):
    """The authors' vanilla GAN."""

    def __init__(self, settings: Variant, data: Data, name: str = "vanilla") -> None:
        super().__init__(settings, data, name)
        images = self.generator.scaling.image(data.seeds).float()
        network = ConvolutionalDiscriminator(width=settings.width)
        self.discriminator = Adversary(network, images, lambda batch: batch.images)

    def make_generator(self) -> TrajectoryGenerator:
        """The authors' generator of scrambled images."""
        settings, family, arm = self.settings, self.data.trajectory, self.data.constraints.arm
        layout = Layout(family.joints, family.harmonics)
        if layout.shape != IMAGE:
            raise ConfigError(
                f"{self.name}: the published networks see images of shape {IMAGE}, of 7 joints and 6 "
                f"harmonics; these trajectories have {family.joints} joints and {family.harmonics} harmonics"
            )
        network = ConvolutionalGenerator(settings.noise, settings.width, settings.batch)
        return TrajectoryGenerator(network, layout, family, arm.name, arm.digest, self.name)

    def convert(self, batch: Batch) -> Tensor:
        """Features that the converter predicts from images, (B, p)."""
        return self.converter(batch.images)

    def losses(self) -> list[Loss]:
        """The adversarial loss."""
        return [Loss(self.settings.weights.adversarial, self.discriminator)]


class PublishedEigen(PublishedVanilla):
    """The authors' variant for the eigenvalues of YᵀY.

    The second discriminator's examples are what the converter says of the seeds, not their true features.
    """

    def __init__(self, settings: Variant, data: Data, name: str = "eigen") -> None:
        super().__init__(settings, data, name)
        with torch.no_grad():
            features = self.converter(self.generator.scaling.image(data.seeds).float())
        network = ConvolutionalDiscriminator(features.shape[1], settings.width)
        self.second_discriminator = Adversary(network, features, lambda batch: batch.features)

    def losses(self) -> list[Loss]:
        """The vanilla GAN's, failure by the success predictor, the second discriminator, and fitness."""
        weights, start, published = (
            self.settings.weights,
            self.settings.fitness_start,
            self.settings.published,
        )
        kind = "entropy" if published is None else published.fitness
        return [
            *super().losses(),
            Loss(weights.success, failure(self.success_predictor), growing(start)),
            Loss(weights.features, self.second_discriminator),
            Loss(weights.fitness, lambda batch: fitness(batch.features, kind), from_epoch(start)),
        ]


class PublishedDiagonal(PublishedEigen):
    """The authors' variant for the diagonal of YᵀY."""


def failure(predictor: nn.Module) -> Value:
    """One minus the mean probability of being valid, by a success predictor of images."""
    return lambda batch: 1 - predictor(batch.images).sigmoid().mean()


def growing(start: int) -> Factor:
    """Factor of a weight that grows from an epoch on."""
    return lambda epoch, share: 1 + _GROWTH * max(0, epoch - start)


def fitness(features: Tensor, kind: str) -> Tensor:
    """Fitness loss of predicted features (B, p), 0-dimensional; ``kind`` as in ``settings.Published``."""
    x = features.clamp_min(_TINY)
    if kind == "ratio":
        return (x.amax(1) / x.amin(1)).mean()
    share = x / x.sum(1, keepdim=True)
    entropy = -(share * share.log()).sum(1).mean()
    return entropy if kind == "entropy" else -entropy
