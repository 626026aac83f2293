"""The one adversarial loop, as a Lightning module, for all variants."""

import math
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor, nn

from sidegan.errors import ConfigError
from sidegan.gan.diversity import Diversity
from sidegan.gan.networks import Discriminator, FeatureDiscriminator, Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.gan.variants import Variant

_BETAS = (0.0, 0.9)
_LAST_RATE = 0.05  # of the first one, at the end of a training with decay


class AdversarialLoop(pl.LightningModule):
    """Train a generator against a seed set.

    The generator minimises its adversarial loss (non-saturating: Goodfellow et al. 2014), the second
    discriminator's on the converter's features, −log P(valid) and, from ``fitness_start`` on, the log
    of the predicted ratio of the largest to the smallest feature.

    Args:
        variant: losses and schedule.
        seeds: coefficients of the seed set [rad/s], (N, J, H, 2).
        steps: discriminator steps of the whole training, for the decay of the rates.
        predictor: frozen success predictor, where the variant weighs success.
        converter: frozen converter, where the variant has features.

    Raises:
        ConfigError: when the variant needs a surrogate that is not given.
    """

    def __init__(
        self,
        variant: Variant,
        seeds: Tensor,
        steps: int,
        predictor: SuccessPredictor | None = None,
        converter: Converter | None = None,
    ) -> None:
        super().__init__()
        if variant.features != "none" and converter is None:
            raise ConfigError(f"{variant.name} needs a converter to {variant.features}")
        if variant.weights.success > 0 and predictor is None:
            raise ConfigError(f"{variant.name} needs a predictor of success")
        self.automatic_optimization = False
        self.variant, self.predictor, self.converter = variant, predictor, converter
        self.steps = steps
        joints, harmonics = seeds.shape[1:3]
        scaling = Scaling.fit(seeds, variant.scaling)
        self.generator = Generator(
            joints, harmonics, variant.noise, variant.body, variant.width, variant.gaussian_start
        )
        self.critic = Discriminator(joints, harmonics, variant.body, variant.width, variant.minibatch)
        self.feature_critic: FeatureDiscriminator | None = None
        if converter is not None:
            self.feature_critic = FeatureDiscriminator(len(converter.mean), variant.width, variant.minibatch)
        self.register_buffer("mean", scaling.mean.float())
        self.register_buffer("spread", scaling.spread.float())
        self.diversity = Diversity(seeds)
        if variant.gaussian_start:
            self.generator.start_from(scaling.image(seeds.double()))
        self.history: list[dict[str, float]] = []

    @property
    def scaling(self) -> Scaling:
        """The scaling on the module's device."""
        return Scaling(self.mean, self.spread)  # type: ignore[arg-type]

    def sample(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Coefficients [rad/s], (count, J, H, 2) float64 on the CPU, without gradient."""
        with torch.no_grad():
            images = self.generator(self.generator.draw(count, generator))
            return self.scaling.coefficients(images).double().cpu()

    def training_step(self, batch: list[Tensor], _: int) -> None:
        """One discriminator step, then the generator's."""
        real, features = batch[0], batch[1] if len(batch) > 1 else None
        generator, critic = self.optimizers()  # type: ignore[attr-defined]
        critic.zero_grad()
        self.manual_backward(self._critic_loss(real, features))
        critic.step()
        for _step in range(self.variant.generator_steps):
            generator.zero_grad()
            self.manual_backward(self._generator_loss(len(real)))
            generator.step()
        for schedule in self.lr_schedulers():  # type: ignore[union-attr]
            schedule.step()

    def configure_optimizers(self) -> tuple[list[torch.optim.Optimizer], list[Any]]:
        """Adam for the generator, and for both discriminators."""
        critics = list(self.critic.parameters())
        if self.feature_critic is not None:
            critics += list(self.feature_critic.parameters())
        adams: list[torch.optim.Optimizer] = [
            torch.optim.Adam(self.generator.parameters(), self.variant.learning_rate, _BETAS),
            torch.optim.Adam(critics, self.variant.critic_rate, _BETAS),
        ]
        schedules = [torch.optim.lr_scheduler.LambdaLR(adam, self._rate) for adam in adams]
        return adams, schedules

    def _rate(self, step: int) -> float:
        if not self.variant.decay:
            return 1.0
        return _LAST_RATE + (1 - _LAST_RATE) * 0.5 * (1 + math.cos(math.pi * min(1.0, step / self.steps)))

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Keep the history of metrics with the weights."""
        checkpoint["history"] = self.history

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Go on with the history."""
        self.history = checkpoint["history"]

    def _critic_loss(self, real: Tensor, features: Tensor | None) -> Tensor:
        with torch.no_grad():
            fake = self.generator(self.generator.draw(len(real)))
        loss = self._against(self.critic, real, fake)
        if self.feature_critic is not None and self.converter is not None and features is not None:
            with torch.no_grad():
                fake_features = self.converter(self.scaling.coefficients(fake))
            loss = loss + self._against(self.feature_critic, features, fake_features)
        return loss

    def _against(self, critic: nn.Module, real: Tensor, fake: Tensor) -> Tensor:
        real = real.detach().requires_grad_(True)
        on_real = critic(real)
        loss = nn.functional.softplus(-on_real).mean() + nn.functional.softplus(critic(fake)).mean()
        if self.variant.gradient_penalty > 0:
            (slope,) = torch.autograd.grad(on_real.sum(), real, create_graph=True)
            loss = loss + self.variant.gradient_penalty / 2 * (slope**2).flatten(1).sum(1).mean()
        return loss

    def _generator_loss(self, count: int) -> Tensor:
        weights = self.variant.weights
        fake = self.generator(self.generator.draw(count))
        loss = weights.adversarial * nn.functional.softplus(-self.critic(fake)).mean()
        c = self.scaling.coefficients(fake)
        if self.predictor is not None and weights.success > 0:
            loss = loss - weights.success * self.predictor(c).mean()
        if self.converter is not None and self.feature_critic is not None:
            features = self.converter(c)
            loss = loss + weights.features * nn.functional.softplus(-self.feature_critic(features)).mean()
            if weights.fitness > 0 and self.current_epoch >= self.variant.fitness_start:
                logs = self.converter.log_features(features)
                loss = loss + weights.fitness * (logs.amax(1) - logs.amin(1)).mean()
        if weights.spread > 0:
            loss = loss + weights.spread * self.diversity.spread_loss(c)
        if weights.distance > 0:
            loss = loss + weights.distance * self.diversity.distance_loss(c)
        return loss
