"""The one adversarial loop, as a Lightning module, for all variants."""

import math
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor, nn

from sidegan.errors import ConfigError, SideganError
from sidegan.gan.diversity import Diversity
from sidegan.gan.exact import ExactFeatures, ExactPhysics
from sidegan.gan.limits import Limits
from sidegan.gan.networks import Discriminator, FeatureDiscriminator, Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.gan.variants import Variant

_BETAS = (0.0, 0.9)
_LONE_BETAS = (0.9, 0.99)  # of a generator that no discriminator follows
_LAST_RATE = 0.05  # of the first one, at the end of a training with decay
_RANDOM_DISTANCE = 0.93  # share of the mean distance of random trajectories that use all of their limits
_EASED = 0.67  # of a training, over which the weight of violations grows


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
        physics: exact physics in place of both, where the variant is exact.
        limits: last layer of the generator, where the variant is limited.

    Raises:
        ConfigError: when the variant needs a part that is not given.
    """

    def __init__(
        self,
        variant: Variant,
        seeds: Tensor,
        steps: int,
        predictor: SuccessPredictor | None = None,
        converter: Converter | ExactFeatures | None = None,
        physics: ExactPhysics | None = None,
        limits: Limits | None = None,
    ) -> None:
        super().__init__()
        _refuse_missing(variant, predictor, converter, physics, limits)
        self.automatic_optimization = False
        self.variant, self.predictor, self.converter = variant, predictor, converter
        self.physics, self.limits = physics, limits
        self.steps = steps
        joints, harmonics = seeds.shape[1:3]
        scaling = Scaling.fit(seeds, variant.scaling)
        self.generator = Generator(
            joints,
            harmonics,
            variant.noise,
            variant.body,
            variant.width,
            variant.gaussian_start,
            variant.activation,
        )
        self.critic: Discriminator | None = None
        if variant.seeded:
            self.critic = Discriminator(joints, harmonics, variant.body, variant.width, variant.minibatch)
        self.feature_critic: FeatureDiscriminator | None = None
        if converter is not None:
            self.feature_critic = FeatureDiscriminator(len(converter.mean), variant.width, variant.minibatch)
        self.register_buffer("mean", scaling.mean.float())
        self.register_buffer("spread", scaling.spread.float())
        batch = min(variant.batch, len(seeds))
        self.diversity = (
            Diversity(seeds, batch) if variant.seeded else Diversity(seeds, batch, _RANDOM_DISTANCE)
        )
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
            return self._coefficients(self.generator(self.generator.draw(count, generator))).double().cpu()

    def _coefficients(self, images: Tensor) -> Tensor:
        c = self.scaling.coefficients(images)
        return c if self.limits is None else self.limits(c)

    def training_step(self, batch: list[Tensor], _: int) -> None:
        """One discriminator step, then the generator's."""
        real, features = batch[0], batch[1] if len(batch) > 1 else None
        generator, *critics = _several(self.optimizers())
        for critic in critics:
            self._step(critic, self._critic_loss(real, features), None)
        for _ in range(self.variant.generator_steps):
            self._step(generator, self._generator_loss(len(real)), self.variant.clip)
        for schedule in _several(self.lr_schedulers()):
            schedule.step()

    def _step(self, adam: Any, loss: Tensor, clip: float | None) -> None:
        """One step of an optimiser; a loss that is not a number ends the training before it does harm."""
        if not torch.isfinite(loss):
            raise SideganError(
                f"{self.variant.name} diverged in epoch {self.current_epoch}: "
                f"the loss is {float(loss.detach())}; the last whole epoch is kept"
            )
        adam.zero_grad()
        self.manual_backward(loss)
        if clip is not None:
            nn.utils.clip_grad_norm_(self.generator.parameters(), clip)
        adam.step()

    def configure_optimizers(self) -> tuple[list[torch.optim.Optimizer], list[Any]]:
        """Adam for the generator, and for both discriminators where there are any."""
        modules = [module for module in (self.critic, self.feature_critic) if module is not None]
        critics = [parameter for module in modules for parameter in module.parameters()]
        betas = _BETAS if critics else _LONE_BETAS
        adams: list[torch.optim.Optimizer] = [
            torch.optim.Adam(self.generator.parameters(), self.variant.learning_rate, betas)
        ]
        if critics:
            adams.append(torch.optim.Adam(critics, self.variant.critic_rate, _BETAS))
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
            c = self._coefficients(fake)
            fake = fake if self.limits is None else self.scaling.image(c)
        loss = c.new_zeros(())
        if self.critic is not None:
            loss = self._against(self.critic, real, fake)
        if self.feature_critic is not None and self.converter is not None and features is not None:
            with torch.no_grad():
                fake_features = self.converter(c)
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
        c = self._coefficients(fake)
        loss = c.new_zeros(())
        if self.critic is not None:
            fake = fake if self.limits is None else self.scaling.image(c)
            loss = weights.adversarial * nn.functional.softplus(-self.critic(fake)).mean()
        if self.predictor is not None and weights.success > 0:
            loss = loss - weights.success * self.predictor(c).mean()
        if self.physics is not None:
            loss = loss + self._physics_loss(self.physics, c)
        if self.converter is not None and self.feature_critic is not None:
            loss = loss + self._feature_loss(self.converter(c), self.converter, self.feature_critic)
        if weights.spread > 0:
            loss = loss + weights.spread * self.diversity.spread_loss(c)
        if weights.distance > 0:
            loss = loss + weights.distance * self.diversity.distance_loss(c)
        if weights.rank > 0:
            loss = loss + weights.rank * self.diversity.rank_loss(c)
        return loss

    def _physics_loss(self, physics: ExactPhysics, c: Tensor) -> Tensor:
        steps = _several(self.lr_schedulers())[0].last_epoch
        weights, done = self.variant.weights, min(1.0, steps / (_EASED * self.steps))
        loss = c.new_zeros(())
        if weights.success > 0:
            loss = weights.success * physics.ease ** (1 - done) * physics.violation(c).mean()
        if weights.fitness > 0:
            loss = loss + weights.fitness * physics.fitness(c)
        return loss

    def _feature_loss(
        self, features: Tensor, converter: Converter | ExactFeatures, critic: FeatureDiscriminator
    ) -> Tensor:
        weights = self.variant.weights
        loss = weights.features * nn.functional.softplus(-critic(features)).mean()
        rewarded = weights.fitness > 0 and self.physics is None
        if rewarded and self.current_epoch >= self.variant.fitness_start:
            logs = converter.log_features(features)
            loss = loss + weights.fitness * (logs.amax(1) - logs.amin(1)).mean()
        return loss


def _refuse_missing(
    variant: Variant,
    predictor: SuccessPredictor | None,
    converter: Converter | ExactFeatures | None,
    physics: ExactPhysics | None,
    limits: Limits | None,
) -> None:
    needs = {
        f"a converter to {variant.features}": variant.features != "none" and converter is None,
        "a predictor of success": variant.exact is None and variant.weights.success > 0 and predictor is None,
        "exact physics": variant.exact is not None and physics is None,
        "a layer of limits": variant.limited and limits is None,
    }
    for what, missing in needs.items():
        if missing:
            raise ConfigError(f"{variant.name} needs {what}")


def _several(x: Any) -> list[Any]:
    """Lightning gives one optimiser or schedule as itself, several as a list."""
    return list(x) if isinstance(x, (list, tuple)) else [x]
