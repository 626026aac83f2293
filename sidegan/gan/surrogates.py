"""Networks that stand for the physics in the generator's loss: success predictor and converter.

Both see the trajectory rolled out in time and work on each time point alike (a convolution of kernel
one), then pool over time: the worst moment decides validity, the mean makes up YᵀY.
"""

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn

from sidegan.base.typed import Count
from sidegan.errors import ConfigError
from sidegan.gan.rollout import RollOut
from sidegan.gan.variants import Variant
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

_TINY = 1e-12  # features below it count as it
_LEAST_SPREAD = 1e-3  # of log features
_START_GAIN = 3.0  # log; higher ones let the labels drown the margins early on


@dataclass(frozen=True)
class PublishedSurrogates:
    """How the published surrogates are trained."""

    shipped: bool  # the authors' weights from seeds.folder in place of a training
    steps: Count  # of batches of 100


@dataclass(frozen=True)
class SurrogateSettings:
    """How success predictor and converters are trained, before any variant that learns from them."""

    samples: Count
    epochs: Count
    width: Count
    margin_steps: Count  # time points per trajectory at which margins are predicted
    feature_steps: Count  # time points per trajectory that the converter sees
    negatives: dict[str, Variant]  # whose output the surrogates learn from, beside the seeds
    published: PublishedSurrogates | None  # as their authors published them; null: ours

    def __post_init__(self) -> None:
        if len(self.negatives) != 1:
            raise ConfigError(f"negatives are of one variant, got {sorted(self.negatives)}")


class SuccessPredictor(nn.Module):
    """Log probability of being valid, (B,), from margins by moment, of coefficients (B, J, H, 2).

    The limits on motion, the first constraints, are linear in the coefficients, so their margins are computed
    from the roll-out's last channels; torque, self-collision and keep-out margins are learned.
    """

    def __init__(
        self, arm: Arm, trajectory: Trajectory, constraints: int, width: int = 96, steps: int = 80
    ) -> None:
        super().__init__()
        self.roll_out = RollOut(arm, trajectory, steps)
        learned = constraints - self.roll_out.linear
        self.layers: nn.Sequential | None = None  # an arm may have nothing to learn about
        if learned:
            self.layers = _by_moment(self.roll_out.channels, width, width, width, learned)
        self.log_gain = nn.Parameter(torch.full((constraints,), _START_GAIN))
        self.offset = nn.Parameter(torch.zeros(constraints))

    def margins(self, c: Tensor) -> Tensor:
        """Predicted margins by moment, (B, G, T), in the units of ``labels.scaled_margins``."""
        channels = self.roll_out(c)
        linear = 1 - channels[:, -self.roll_out.linear :]
        return linear if self.layers is None else torch.cat([linear, self.layers(channels)], 1)

    def forward(self, c: Tensor) -> Tensor:
        """Log probability of being valid, (B,)."""
        return self.log_probability(self.margins(c))

    def log_probability(self, margins: Tensor) -> Tensor:
        """Log probability of being valid, (B,), of predicted margins (B, G, T)."""
        worst = margins.amin(2)
        return nn.functional.logsigmoid(self.log_gain.exp() * (worst - self.offset)).sum(1)


class Converter(nn.Module):
    """Standardised log spectrum (or log diagonal) of YᵀY, (B, p), of coefficients (B, J, H, 2)."""

    mean: Tensor
    spread: Tensor

    def __init__(
        self, arm: Arm, trajectory: Trajectory, features: int, width: int = 128, steps: int = 48
    ) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(features))
        self.register_buffer("spread", torch.ones(features))
        self.roll_out = RollOut(arm, trajectory, steps)
        self.moments = _by_moment(self.roll_out.channels, width, width, width)
        self.pooled = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, features))
        self.linear = nn.Linear(width, features)

    def forward(self, c: Tensor) -> Tensor:
        """Standardised log features, (B, p)."""
        moments = self.moments(self.roll_out(c))
        log_energy = torch.log(1e-4 + (moments * moments).mean(2))
        return self.pooled(torch.cat([moments.mean(2), log_energy], 1)) + self.linear(log_energy)

    def standardise(self, features: Tensor) -> Tensor:
        """Standardised logs of true features (B, p)."""
        return (_logs(features) - self.mean) / self.spread

    def log_features(self, standardised: Tensor) -> Tensor:
        """Natural logs of features, from standardised ones."""
        return standardised * self.spread + self.mean

    @torch.no_grad()
    def fit_standard(self, features: Tensor) -> None:
        """Set mean and spread from true features (N, p)."""
        x = _logs(features)
        self.mean.copy_(x.mean(0))
        self.spread.copy_(x.std(0).clamp_min(_LEAST_SPREAD))


def _logs(features: Tensor) -> Tensor:
    return features.clamp_min(_TINY).log().float()


@dataclass(frozen=True)
class Surrogates:
    """The frozen surrogates of one variant, as far as it needs them."""

    predictor: nn.Module | None = None
    converter: nn.Module | None = None


class _ByMoment(nn.Sequential):
    """Convolutions of kernel one, as one product for all moments of all trajectories: twice as fast."""

    def forward(self, x: Tensor) -> Tensor:
        """Channels (B, C, T), of others (B, C', T)."""
        y = x.transpose(0, 1).flatten(1)
        for layer in self:
            if isinstance(layer, nn.Conv1d) and layer.bias is not None:
                y = torch.addmm(layer.bias[:, None], layer.weight[:, :, 0], y)
            else:
                y = layer(y)
        return y.unflatten(1, (len(x), -1)).transpose(0, 1)


def _by_moment(*channels: int) -> nn.Sequential:
    """Layers that treat every time point alike, with a ReLU between two of them."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(channels):
        layers += [nn.Conv1d(inputs, outputs, 1), nn.ReLU()]
    return _ByMoment(*layers[:-1])
