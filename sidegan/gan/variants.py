"""The variants of SIDE-GAN by the losses that they add."""

from sidegan.design.excitation import excitation_of
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError
from sidegan.gan.losses import (
    Adversary,
    Loss,
    eased,
    from_epoch,
    log_ratio,
    objective,
    predicted_failure,
    violation,
)
from sidegan.gan.networks import Discriminator
from sidegan.gan.published import PublishedDiagonal, PublishedEigen, PublishedVanilla
from sidegan.gan.settings import Variant
from sidegan.gan.side_gan import Data, SideGAN
from sidegan.motion.dynamics import gram


class Vanilla(SideGAN):
    """A vanilla GAN: trajectories that a discriminator takes for seeds."""

    def __init__(self, settings: Variant, data: Data, name: str = "vanilla") -> None:
        super().__init__(settings, data, name)
        images = self.generator.scaling.image(data.seeds.float())
        network = Discriminator(images[0].numel(), settings.width)
        self.discriminator = Adversary(network, images, lambda batch: batch.images)

    def losses(self) -> list[Loss]:
        """The adversarial loss."""
        return [Loss(self.settings.weights.adversarial, self.discriminator)]


class Eigen(Vanilla):
    """Valid trajectories, with even eigenvalues of YᵀY that a second discriminator takes for the seeds'."""

    def __init__(self, settings: Variant, data: Data, name: str = "eigen") -> None:
        super().__init__(settings, data, name)
        body, trajectory = data.constraints.body, data.trajectory
        true = getattr(excitation_of(body, gram(body, trajectory, data.seeds)), str(settings.features))
        features = self.converter.standardise(true)
        network = Discriminator(features.shape[1], settings.width)
        self.second_discriminator = Adversary(network, features, lambda batch: batch.features)

    def losses(self) -> list[Loss]:
        """The vanilla GAN's, failure by the success predictor, the second discriminator, and fitness."""
        weights, start = self.settings.weights, self.settings.fitness_start
        return [
            *super().losses(),
            Loss(weights.success, predicted_failure(self.success_predictor)),
            Loss(weights.features, self.second_discriminator),
            Loss(weights.fitness, log_ratio(self.converter.log_features), from_epoch(start)),
        ]


class Diagonal(Eigen):
    """Losses of ``Eigen``, on the diagonal of YᵀY in place of its eigenvalues."""


class Exact(SideGAN):
    """Exact physics of the arm in place of seeds, discriminators and surrogates.

    The seeds of its data are random trajectories, of which it has scale and diversity.
    """

    def losses(self) -> list[Loss]:
        """Violation of the constraints, and exact objectives."""
        weights, exact = self.settings.weights, self.settings.exact
        if exact is None:
            raise ConfigError(f"{self.name} needs settings exact")
        problem = Problem(self.data.constraints, self.data.trajectory, exact.samples)
        return [
            Loss(weights.success, violation(problem, exact.reserve), eased(exact.ease)),
            Loss(weights.fitness, objective(problem, exact.terms.values())),
        ]


VARIANTS: dict[str, type[SideGAN]] = {
    one.__name__: one
    for one in (Vanilla, Eigen, Diagonal, Exact, PublishedVanilla, PublishedEigen, PublishedDiagonal)
}
