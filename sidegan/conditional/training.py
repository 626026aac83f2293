"""Training of a conditional generator: exact physics of batches under conditions drawn at random."""

import time
from functools import cached_property
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader, TensorDataset

from sidegan.conditional.condition import Condition
from sidegan.conditional.generator import ConditionalGenerator
from sidegan.conditional.problem import ConditionedProblem, information_losses, variances
from sidegan.conditional.settings import TrainingSettings
from sidegan.conditional.shaping import Shaping
from sidegan.conditional.space import ConditionSpace
from sidegan.conditional.study import outcome
from sidegan.errors import ConfigError
from sidegan.gan.diversity import Distance, Rank, distance_target, rank_target
from sidegan.gan.exact import penalty_of
from sidegan.gan.loop import EpochEnd, Training, fit
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.schedule import Schedule
from sidegan.gan.terms import LossTerm
from sidegan.gan.training import Trained, random_trajectories
from sidegan.validity import Constraints

_POOL = 20_000  # conditions drawn once, of which every step takes some
_REFERENCE = 400  # random trajectories, whose median variance each parameter's is compared with
_CLIP = 10.0  # largest norm of the gradient


class ConditionedBatch:
    """Trajectories of a generator under conditions, so many in a row under the same one.

    Args:
        coefficients: [rad/s], (B, J, H, 2).
        problem: the same trajectories with their conditions.
        size: of trajectories that suit each condition, (B, J).
        together: trajectories in a row under one condition.
    """

    def __init__(
        self, coefficients: Tensor, problem: ConditionedProblem, size: Tensor, together: int
    ) -> None:
        self.coefficients, self.problem = coefficients, problem
        self._size, self._together = size, together

    @cached_property
    def groups(self) -> Tensor:
        """Coefficients, all of one size, by condition, (K, together, 2 J H)."""
        x = self.coefficients / self._size[:, :, None, None]
        return x.flatten(1).unflatten(0, (-1, self._together))

    @property
    def deviations(self) -> Tensor:
        """Coefficients from the mean of those under the same condition, (B, 2 J H)."""
        return (self.groups - self.groups.mean(1, keepdim=True)).flatten(0, 1)

    def mean_distance(self) -> Tensor:
        """Mean distance between two trajectories under the same condition [rad/s], 0-dimensional."""
        first, second = torch.triu_indices(self._together, self._together, 1)
        return (self.groups[:, first] - self.groups[:, second]).norm(dim=2).mean()


class ConditionSampler(nn.Module):
    """Batches of a generator, each of their conditions drawn from a pool.

    Args:
        generator: whose network learns.
        pool: conditions.
        settings: time points, and trajectories per condition.
    """

    def __init__(self, generator: ConditionalGenerator, pool: Condition, settings: TrainingSettings) -> None:
        super().__init__()
        self.network, self.generator = generator.network, generator
        self.pool, self.settings = pool, settings
        constraints = generator.space.constraints
        self.quiet = Constraints(constraints.arm, constraints.regions, torque=False)

    def problem(self, condition: Condition) -> ConditionedProblem:
        """The trajectories under these conditions."""
        space = self.generator.space
        return ConditionedProblem(
            self.quiet,
            space.trajectory,
            self.settings.samples,
            condition=condition,
            surroundings=space.surroundings,
            torque=space.constraints.torque,
        )

    def forward(self, count: int) -> ConditionedBatch:
        """So many trajectories."""
        together = self.settings.together
        rows = torch.randint(len(self.pool), (count // together,))
        condition = self.pool.take(rows).repeat(together)
        c = self.generator.coefficients(condition)
        size = self.generator.shaping.size(condition)
        return ConditionedBatch(c, self.problem(condition), size, together)


class ConditionedViolation(LossTerm[ConditionedBatch]):
    """Mean squared relative violation of constraints and conditions."""

    def __init__(self, settings: TrainingSettings) -> None:
        super().__init__(settings.violation, settings.ease)
        self.penalty = penalty_of(settings.reserve)

    def forward(self, batch: ConditionedBatch) -> Tensor:
        """Loss, 0-dimensional."""
        return batch.problem.violation(batch.coefficients, self.penalty).mean()


class ConditionedInformation(LossTerm[ConditionedBatch]):
    """Log condition number, and with an emphasis the log variance of the links that matter.

    Args:
        emphasis: weight of the log variance.
        usual: variance of each base parameter, (p,), in units of which variances count.
        links: link of each base parameter, (p,).
    """

    def __init__(self, emphasis: float, usual: Tensor, links: Tensor) -> None:
        super().__init__(1.0)
        self.emphasis, self.usual, self.links = emphasis, usual, links

    def forward(self, batch: ConditionedBatch) -> Tensor:
        """Loss, 0-dimensional."""
        weights = batch.problem.condition.links[:, self.links] / self.usual
        ratio, variance = information_losses(batch.problem, batch.coefficients, weights)
        return ratio.mean() + self.emphasis * variance.mean()


def train(
    space: ConditionSpace,
    settings: TrainingSettings,
    work: Path,
    seed: int,
    only: Condition | None = None,
    epoch_end: EpochEnd | None = None,
) -> Trained[ConditionalGenerator]:
    """A conditional generator of one arm.

    Args:
        space: the arm in its workspace, and the conditions that may be requested.
        settings: how it is trained.
        work: folder of the checkpoint from which an interrupted training goes on.
        seed: of weights, noise and conditions.
        only: the one condition of a dedicated generator, a batch of one; None: whatever may be requested.
        epoch_end: called with (epoch, metrics) after every epoch.

    Raises:
        ConfigError: when nothing may be requested, or the one condition is outside of the ranges.
        InfeasibleError: when the arm has no room at home under hardly any condition, or under the one.
        SideganError: when the training diverges.
    """
    torch.manual_seed(seed)
    if not space.size:
        raise ConfigError("nothing may be asked for: give one range or more")
    if only is not None:
        space.refuse(only)
    pool = only or space.draw(_POOL, torch.Generator().manual_seed(seed))
    start = random_trajectories(space.constraints, space.trajectory, seed)
    generator = _untrained(space, settings, start)
    sampler = ConditionSampler(generator, pool, settings)
    body, reference = space.constraints.body, start[:_REFERENCE]
    usual = variances(body, sampler.problem(space.neutral(len(reference))).gram(reference)).median(0).values
    terms: list[LossTerm[Any]] = [
        ConditionedViolation(settings),
        ConditionedInformation(settings.emphasis, usual, body.base.columns // 10),
        Distance(settings.distance, distance_target(start, random=True)),
        Rank(settings.rank, rank_target(start, settings.batch)),
    ]
    rates = Schedule(settings.epochs, settings.steps, settings.batch, settings.learning_rate, clip=_CLIP)
    training = Training("conditional", sampler, terms, rates)
    began = time.monotonic()

    def evaluate(epoch: int) -> dict[str, float]:
        nonlocal began
        if not all(bool(torch.isfinite(x).all()) for x in generator.network.parameters()):
            training.stop("not a number")
        metrics = _measure(sampler, seed, epoch)
        metrics["seconds"], began = time.monotonic() - began, time.monotonic()
        return metrics

    steps = TensorDataset(torch.arange(settings.steps * settings.batch))
    fit(training, DataLoader(steps, settings.batch), work, evaluate, epoch_end)
    generator.network.eval()
    return Trained(generator, training.history)


def _untrained(space: ConditionSpace, settings: TrainingSettings, start: Tensor) -> ConditionalGenerator:
    """A generator that yields the Gaussian of random trajectories."""
    joints, harmonics, _ = space.trajectory.shape
    noise, scaling = settings.noise + space.size, Scaling.fit(start)
    network = Generator(joints, harmonics, noise, "mlp", settings.width, shortcut=True, activation="silu")
    network.start_from(scaling.image(start))
    scaling = Scaling(scaling.mean.float(), scaling.spread.float())
    return ConditionalGenerator(network, scaling, Shaping.reach_of(space.trajectory, start), space)


def _measure(sampler: ConditionSampler, seed: int, epoch: int) -> dict[str, float]:
    """True physics of a few trajectories under each of a few conditions."""
    settings, pool = sampler.settings, sampler.pool
    if not settings.evaluation:
        return {}
    random = torch.Generator().manual_seed(seed * 1_000_003 + epoch)
    rows = torch.randint(len(pool), (settings.evaluation,), generator=random)
    conditions = pool.take(rows)
    return outcome(sampler.generator, conditions, settings.together, random, settled=False).summary()
