"""Terms of a generator's loss, each a small object; those of discriminators and of surrogates."""

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property

import torch
from torch import Tensor, nn

from sidegan.gan.limits import LimitLayer
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.surrogates import Converter, SuccessPredictor


class Batch:
    """Trajectories that a generator made, and what terms look at; computed once, when first looked at."""

    def __init__(
        self, coefficients: Tensor, images: Callable[[], Tensor], features: Callable[[Tensor], Tensor] | None
    ) -> None:
        self.coefficients, self._images, self._features = coefficients, images, features

    @cached_property
    def images(self) -> Tensor:
        """Images (B, 2, J, H) of the coefficients."""
        return self._images()

    @cached_property
    def features(self) -> Tensor:
        """Standardised log features, (B, p)."""
        if self._features is None:
            raise TypeError("these trajectories come without features")
        return self._features(self.coefficients)


class Sampler(nn.Module):
    """Batches of a generator: noise → images → coefficients, within limits where there is a layer of them.

    The features are a converter to what some terms look at.
    """

    mean: Tensor
    spread: Tensor

    def __init__(
        self, network: Generator, scaling: Scaling, limits: LimitLayer | None, features: Converter | None
    ) -> None:
        super().__init__()
        self.network, self.limits, self.features = network, limits, features
        self.register_buffer("mean", scaling.mean.float())
        self.register_buffer("spread", scaling.spread.float())

    @property
    def scaling(self) -> Scaling:
        """The scaling on the module's device."""
        return Scaling(self.mean, self.spread)

    def forward(self, count: int, random: torch.Generator | None = None) -> Batch:
        """So many trajectories."""
        images = self.network.sample(count, random)
        c = self.scaling.coefficients(images)
        if self.limits is None:
            return Batch(c, lambda: images, self.features)
        c = self.limits(c)
        return Batch(c, lambda: self.scaling.image(c), self.features)


class LossTerm(nn.Module):
    """One weighted term of a generator's loss.

    Args:
        weight: factor of the term.
        ease: share of the weight that a training begins with; it grows to all of it, geometrically.
        start: first epoch in which the term counts.
    """

    def __init__(self, weight: float, ease: float = 1.0, start: int = 0) -> None:
        super().__init__()
        self.weight, self.ease, self.start = weight, ease, start

    def weight_at(self, epoch: int, eased: float) -> float:
        """Weight in an epoch, when that share of the growth is over."""
        return self.weight * self.ease ** (1 - eased) if epoch >= self.start else 0.0

    @abstractmethod
    def forward(self, batch: Batch) -> Tensor:
        """Loss without its weight, 0-dimensional."""


class Formula(LossTerm):
    """A term without networks or tensors of its own: a function of a batch."""

    def __init__(
        self, weight: float, loss: Callable[[Batch], Tensor], ease: float = 1.0, start: int = 0
    ) -> None:
        super().__init__(weight, ease, start)
        self.loss = loss

    def forward(self, batch: Batch) -> Tensor:
        """Loss, 0-dimensional."""
        return self.loss(batch)


class Adversary(LossTerm):
    """A discriminator: rewards what it takes for an example.

    Its network gives logits (B,) of its view of a batch, and learns to tell that from examples (N, …). The
    generator's loss is −log D.
    """

    examples: Tensor

    def __init__(
        self,
        weight: float,
        network: nn.Module,
        examples: Tensor,
        view: Callable[[Batch], Tensor],
    ) -> None:
        super().__init__(weight)
        self.network, self.view = network, view
        self.register_buffer("examples", examples.contiguous(), persistent=False)

    def forward(self, batch: Batch) -> Tensor:
        """Mean loss of the generator by this discriminator, 0-dimensional."""
        return nn.functional.softplus(-self.network(self.view(batch))).mean()

    def update_loss(self, rows: Tensor, batch: Batch) -> Tensor:
        """Loss of the discriminator itself on some examples and a batch without gradient, 0-dimensional."""
        on_real, on_fake = self.network(self.examples[rows]), self.network(self.view(batch))
        return nn.functional.softplus(-on_real).mean() + nn.functional.softplus(on_fake).mean()


class PredictedSuccess(LossTerm):
    """Minus the mean log probability of being valid, by a frozen predictor."""

    def __init__(self, weight: float, predictor: SuccessPredictor) -> None:
        super().__init__(weight)
        self.predictor = predictor

    def forward(self, batch: Batch) -> Tensor:
        """Loss, 0-dimensional."""
        return -self.predictor(batch.coefficients).mean()


def predicted_ratio(weight: float, converter: Converter, start: int) -> Formula:
    """Mean log ratio of the largest to the smallest feature, by a frozen converter."""

    def loss(batch: Batch) -> Tensor:
        logs = converter.log_features(batch.features)
        return (logs.amax(1) - logs.amin(1)).mean()

    return Formula(weight, loss, start=start)
