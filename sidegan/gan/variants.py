"""The variants of SIDE-GAN and their losses: ours, then those that the paper's authors published.

The latter follow the code that accompanies Jegorova et al. 2020 (``seeding.published.REPOSITORY``), even
where the paper's text differs.
"""

from typing import Any, cast

import torch
from torch import Tensor, nn

from sidegan.design.excitation import measure_excitation
from sidegan.design.objective import Penalty
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError
from sidegan.gan.losses import Adversary, Batch, Loss, Value
from sidegan.gan.metrics import noises
from sidegan.gan.networks import Discriminator
from sidegan.gan.published import ConvolutionalDiscriminator
from sidegan.gan.reward import Energies, Worth, violation
from sidegan.gan.settings import ExactPhysics, Published, Variant
from sidegan.gan.side_gan import Data, SideGAN
from sidegan.gan.tensors import numpy_array

_FIRST_WEIGHT = 0.1  # initial share of the violations' weight
_FULL_WEIGHT = 0.4  # share of the training until it is 1
_CLEARANCE_RESERVE = 4.0  # reserve of clearance in units of 0.25 m, relative to that of torques
_GROWTH = 0.06  # growth of the published weight of success per epoch, once fitness counts
_TINY = 1e-12


class Vanilla(SideGAN):
    """A vanilla GAN: trajectories that a discriminator takes for seeds."""

    def __init__(self, settings: Variant, data: Data, name: str = "vanilla") -> None:
        super().__init__(settings, data, name)
        images = self.generator.scaling.image(self.seeds)
        self.discriminator = self.adversary(images, lambda batch: batch.images)

    def adversary(self, examples: Tensor, view: Value) -> Adversary:
        """An untrained discriminator of examples (N, …) from views of a batch."""
        settings = self.settings.generator
        critic: nn.Module = Discriminator(examples[0].numel(), settings.width)
        if settings.network == "convolutional":
            critic = ConvolutionalDiscriminator(examples.shape[1:], settings.width)
        return Adversary(critic, examples, view, settings.penalty)

    def losses(self) -> list[Loss]:
        """The adversarial loss."""
        return [Loss(self.settings.weights.adversarial, self.discriminator, "adversarial")]


class Eigen(Vanilla):
    """Valid trajectories with even eigenvalues of YᵀY, which a second discriminator takes for the seeds'."""

    def __init__(self, settings: Variant, data: Data, name: str = "eigen") -> None:
        super().__init__(settings, data, name)
        if data.success_predictor is None or data.converter is None:
            raise ConfigError(f"{name} needs a success predictor and a converter to {settings.features}")
        self.second_discriminator = self.adversary(self.seeds_features(), lambda batch: batch.features)

    def seeds_features(self) -> Tensor:
        """Exact features of the seeds, (N, p), standardised like the converter's."""
        data = self.data
        excitation = measure_excitation(data.constraints.body, data.trajectory, data.seeds)
        return self.converter.standardise(torch.tensor(getattr(excitation, str(self.settings.features))))

    def losses(self) -> list[Loss]:
        """The vanilla GAN's loss, predicted failure, the second discriminator, and fitness."""
        weights = self.settings.weights
        fit = self.current_epoch >= self.settings.fitness_start
        return [
            *super().losses(),
            Loss(weights.success, self.failure, "success"),
            Loss(weights.features, self.second_discriminator, "features"),
            Loss(weights.fitness * fit, self.fitness, "fitness"),
        ]

    def failure(self, batch: Batch) -> Tensor:
        """Minus the mean log probability of being valid with the reserve."""
        predictor = self.success_predictor
        margins = predictor.margins(batch.coefficients) - self.settings.reserve
        return -predictor.log_probability(margins).mean()

    def fitness(self, batch: Batch) -> Tensor:
        """Mean log ratio of the largest to the smallest predicted feature."""
        logs = self.converter.log_features(batch.features)
        return (logs.amax(1) - logs.amin(1)).mean()


class Diagonal(Eigen):
    """Losses of ``Eigen``, on the diagonal of YᵀY instead of its eigenvalues."""


class Predicting(Eigen):
    """Valid trajectories, rewarded by a converter for sets that predict torques well."""

    energies: Energies

    def seeds_features(self) -> Tensor:
        """Exact energies of the seeds, (N, K), standardised like the converter's."""
        self.energies = Energies(self.data.constraints, self.data.trajectory, self.data.seeds)
        return self.converter.standardise(torch.tensor(self.energies(self.data.seeds)))

    def fitness(self, batch: Batch) -> Tensor:
        """Minus the mean log worth for prediction, from predicted energies."""
        return -self.energies.worth(self.converter.log_features(batch.features), self.settings.reward)


class Exact(SideGAN):
    """Exact physics instead of seeds, discriminators and surrogates; rewarded for prediction.

    The seeds of its data are random trajectories, which set its scaling and target of diversity.
    """

    def __init__(self, settings: Variant, data: Data, name: str = "exact") -> None:
        super().__init__(settings, data, name)
        physics = cast("ExactPhysics", settings.exact)
        self.problem = Problem(data.constraints, data.trajectory, physics.samples)
        weighted = [(getattr(settings.reward, kind), x) for kind, x in noises(self.problem.body).items()]
        self.worths = [(weight, Worth(self.problem, noise)) for weight, noise in weighted if weight]
        # The generator's last layer enforces the limits on motion.
        reserve = physics.reserve
        self.penalty = Penalty(1.0, limits=0.0, torque=reserve, distance=_CLEARANCE_RESERVE * reserve)

    def losses(self) -> list[Loss]:
        """Violation of the constraints, with a weight that grows geometrically, and worth for prediction."""
        weights = self.settings.weights
        ease = _FIRST_WEIGHT ** (1 - min(1.0, self.share / _FULL_WEIGHT))
        return [
            Loss(weights.success * ease, self.violation, "success"),
            Loss(weights.fitness, self.fitness, "fitness"),
        ]

    def violation(self, batch: Batch) -> Tensor:
        """Mean squared relative violation of the constraints, with a reserve."""
        return violation(self.problem, batch.coefficients, self.penalty).mean()

    def fitness(self, batch: Batch) -> Tensor:
        """Minus the mean log worth for prediction, a part of the batch for each noise, with its weight."""
        c = batch.coefficients
        parts = zip(c.chunk(len(self.worths)), self.worths)
        return -torch.stack([weight * worth(part).mean() for part, (weight, worth) in parts]).sum().to(c)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Also save the running means."""
        super().on_save_checkpoint(checkpoint)
        checkpoint["worths"] = [(torch.tensor(worth.means), worth.seen) for _, worth in self.worths]

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Also restore the running means."""
        super().on_load_checkpoint(checkpoint)
        for (_, worth), (means, seen) in zip(self.worths, checkpoint["worths"]):
            worth.means, worth.seen = numpy_array(means), seen


class PublishedEigen(Eigen):
    """The authors' variant for the eigenvalues of YᵀY; their surrogates see images."""

    def seeds_features(self) -> Tensor:
        """Features of the seeds, (N, p), as the converter predicts them."""
        with torch.no_grad():
            return self.converter(self.generator.scaling.image(self.seeds))

    def losses(self) -> list[Loss]:
        """Losses of ``Eigen``; the weight of success grows from the first epoch with fitness."""
        adversarial, success, *others = super().losses()
        growth = 1 + _GROWTH * max(0, self.current_epoch - self.settings.fitness_start)
        return [adversarial, success._replace(weight=success.weight * growth), *others]

    def failure(self, batch: Batch) -> Tensor:
        """One minus the mean probability of being valid."""
        return 1 - self.success_predictor(batch.images).sigmoid().mean()

    def fitness(self, batch: Batch) -> Tensor:
        """Fitness loss of the predicted features, as chosen in ``settings.Published``."""
        return unevenness(batch.features, cast("Published", self.settings.published).fitness)


class PublishedDiagonal(PublishedEigen):
    """The authors' variant for the diagonal of YᵀY."""


def unevenness(features: Tensor, kind: str) -> Tensor:
    """Fitness loss of predicted features (B, p), 0-dimensional; ``kind`` as in ``settings.Published``."""
    x = features.clamp_min(_TINY)
    if kind == "ratio":
        return (x.amax(1) / x.amin(1)).mean()
    share = x / x.sum(1, keepdim=True)
    entropy = -(share * share.log()).sum(1).mean()
    return entropy if kind == "entropy" else -entropy
