"""Networks that replace the physics in the generator's loss: success predictor and converter.

Both apply the same layers to each time point of the rolled-out trajectory (convolutions with kernel size 1),
then pool over time: the worst time decides validity, and YᵀY is a mean.
"""

from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from sidegan.base.arrays import Array
from sidegan.base.parallel import Report
from sidegan.gan.networks import RollOut
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

_TINY = 1e-12  # lower bound of features
_LEAST_SPREAD = 1e-3  # of log features
_START_GAIN = 3.0  # initial log gain; with larger ones the labels dominate the margins early in training
_NEAR = 0.05  # margin beyond which errors count less
_REPORTED = 20  # steps between progress reports
_SMALLER = (0.25, 0.5, 0.75)  # sizes of motions, relative to the seeds
_CLASSIFICATION = 0.3  # weight of the classification loss relative to the margins' loss


class SuccessPredictor(nn.Module):
    """Log probability of being valid, (B,), for coefficients (B, J, H, 2), by way of margins over time.

    The first constraints, limits on motion, are linear in the coefficients: their margins follow from the
    roll-out's last channels. Torque, self-collision and keep-out margins are learned.
    """

    def __init__(self, arm: Arm, trajectory: Trajectory, constraints: int, width: int, steps: int) -> None:
        super().__init__()
        self.roll_out = RollOut(arm, trajectory, steps)
        learned = constraints - self.roll_out.limit_kinds  # number of margins
        self.layers = _PerTime(self.roll_out.channels, width, width, width, learned) if learned else None
        self.log_gain = nn.Parameter(torch.full((constraints,), _START_GAIN))
        self.offset = nn.Parameter(torch.zeros(constraints))

    def margins(self, c: Tensor) -> Tensor:
        """Predicted margins over time, (B, G, T), in the units of ``pretraining.scaled_margins``."""
        channels = self.roll_out(c)
        linear = 1 - channels[:, -self.roll_out.limit_kinds :]
        return linear if self.layers is None else torch.cat([linear, self.layers(channels)], 1)

    def forward(self, c: Tensor) -> Tensor:
        """Log probability of being valid, (B,)."""
        return self.log_probability(self.margins(c))

    def log_probability(self, margins: Tensor) -> Tensor:
        """Log probability of being valid, (B,), from predicted margins (B, G, T)."""
        worst = margins.amin(2)
        return nn.functional.logsigmoid(self.log_gain.exp() * (worst - self.offset)).sum(1)

    def loss(self, c: Tensor, margins: Tensor, valid: Tensor) -> Tensor:
        """Loss of margins over time (B, G, T) and of labels (B,) for coefficients, 0-dimensional."""
        predicted = self.margins(c)
        # Errors count most near zero, the boundary of validity.
        weight = 1 / (_NEAR + margins.abs())
        log_valid = self.log_probability(predicted)
        log_faulty = torch.log(-torch.expm1(log_valid.clamp_max(-1e-6)))
        cross_entropy = -torch.where(valid, log_valid, log_faulty).clamp_min(-10).mean()
        return (weight * (predicted - margins).abs()).mean() + _CLASSIFICATION * cross_entropy

    def accepts(self, c: Tensor) -> Tensor:
        """Whether trajectories are predicted to be valid, (B,)."""
        return self(c).exp() > 0.5


class Converter(nn.Module):
    """Standardised log features, such as the spectrum of YᵀY, (B, p), for coefficients (B, J, H, 2)."""

    def __init__(self, arm: Arm, trajectory: Trajectory, features: int, width: int, steps: int) -> None:
        super().__init__()
        self.mean, self.spread = nn.Buffer(torch.zeros(features)), nn.Buffer(torch.ones(features))
        self.roll_out = RollOut(arm, trajectory, steps)
        self.moments = _PerTime(self.roll_out.channels, width, width, width)
        self.pooled = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, features))
        self.linear = nn.Linear(width, features)

    def forward(self, c: Tensor) -> Tensor:
        """Standardised log features, (B, p)."""
        moments = self.moments(self.roll_out(c))
        log_energy = torch.log(1e-4 + (moments * moments).mean(2))
        return self.pooled(torch.cat([moments.mean(2), log_energy], 1)) + self.linear(log_energy)

    def loss(self, c: Tensor, target: Tensor) -> Tensor:
        """Loss of standardised log features (B, p) for coefficients, 0-dimensional."""
        return nn.functional.smooth_l1_loss(self(c), target)

    @torch.no_grad()
    def explained(self, c: Tensor, features: Tensor) -> Tensor:
        """Coefficient of determination R² of each standardised feature, (p,)."""
        target = self.standardise(features)
        error = self(c) - target
        return 1 - (error**2).mean(0) / target.var(0, unbiased=False).clamp_min(1e-12)

    def standardise(self, features: Tensor) -> Tensor:
        """Standardised logs of exact features (B, p)."""
        return (_logs(features) - self.mean) / self.spread

    def log_features(self, standardised: Tensor) -> Tensor:
        """Logs of features from standardised ones."""
        return standardised * self.spread + self.mean

    @torch.no_grad()
    def fit_standard(self, features: Tensor) -> None:
        """Set mean and spread from exact features (N, p)."""
        x = _logs(features)
        self.mean.copy_(x.mean(0))
        self.spread.copy_(x.std(0).clamp_min(_LEAST_SPREAD))


def scores(
    accepts: Callable[[Tensor], Tensor], seeds: Array, faulty: Array, samples: Array, valid: Array
) -> dict[str, float]:
    """Shares of seeds (N, …) that a predictor accepts, and of faulty samples that it rejects; NaN of none.

    ``accepted_25`` is of the seeds' motions at 25 % of their size. ``accuracy_paper`` is over seeds and
    faulty samples together: it depends on how many there are of each. ``accuracy_broad`` is over samples of
    all kinds with labels ``valid``, (M,).
    """

    def accepted(x: Array) -> Tensor:
        return accepts(torch.tensor(x).float())

    with torch.no_grad():
        of_seeds, rejected = accepted(seeds), ~accepted(faulty)
        shares = {
            "accepted": of_seeds,
            "rejected": rejected,
            "accuracy_paper": torch.cat([of_seeds, rejected]),
            "accuracy_broad": accepted(samples) == torch.tensor(valid),
            **{f"accepted_{100 * share:.0f}": accepted(share * seeds) for share in _SMALLER},
        }
    return {name: float(x.double().mean()) for name, x in shares.items()}


def learn(
    losses: Iterable[Tensor], total: int, adam: torch.optim.Optimizer, progress: Report, rates: Any = None
) -> None:
    """A step of an optimiser on each of ``total`` losses, made in turn; ``rates`` schedules its rates.

    A loop of its own, since ``training.Refreshed`` runs it within a training by Lightning.
    """
    for done, loss in enumerate(losses, 1):
        adam.zero_grad()
        loss.backward()
        adam.step()
        if rates is not None:
            rates.step()
        if done % _REPORTED == 0 or done == total:
            progress(done, total)


def _logs(features: Tensor) -> Tensor:
    """Logarithms of positive features, in single precision."""
    return features.clamp_min(_TINY).log().float()


class _PerTime(nn.Sequential):
    """Layers applied to each time point, with ReLUs in between.

    Convolutions with kernel size 1, computed as a product over all times of all trajectories: twice as fast.
    """

    def __init__(self, *channels: int) -> None:
        layers: list[nn.Module] = []
        for inputs, outputs in pairwise(channels):
            layers += [nn.Conv1d(inputs, outputs, 1), nn.ReLU()]
        super().__init__(*layers[:-1])

    def forward(self, x: Tensor) -> Tensor:
        """Channels (B, C, T) from channels (B, C', T)."""
        y = x.transpose(0, 1).flatten(1)
        for layer in self:
            if isinstance(layer, nn.Conv1d) and layer.bias is not None:
                y = torch.addmm(layer.bias[:, None], layer.weight[:, :, 0], y)
            else:
                y = layer(y)
        return y.unflatten(1, (len(x), x.shape[2])).transpose(0, 1)
