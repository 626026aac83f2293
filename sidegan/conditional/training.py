"""Training of a conditional generator: exact physics of batches under conditions drawn at random."""

import time
from functools import cached_property
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader, TensorDataset

from sidegan.conditional.condition import Condition
from sidegan.conditional.generator import ConditionalGenerator, Shaping
from sidegan.conditional.problem import ConditionedProblem, information_losses, variances
from sidegan.conditional.settings import TrainingSettings
from sidegan.conditional.space import ConditionSpace
from sidegan.conditional.study import outcome
from sidegan.errors import ConfigError
from sidegan.gan.diversity import distance, distance_target, rank, rank_target
from sidegan.gan.exact import penalty_of
from sidegan.gan.loop import EpochEnd, Training, fit
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.schedule import Schedule
from sidegan.gan.terms import Formula, LossTerm
from sidegan.gan.training import Trained, random_trajectories
from sidegan.motion.dynamics import RigidBody
from sidegan.validity import Constraints

_POOL = 20_000  # conditions drawn once, of which every step takes some
_REFERENCE = 400  # random trajectories, whose median variance each parameter's is compared with
_CLIP = 10.0  # largest norm of the gradient


class ConditionedBatch:
    """Trajectories (B, J, H, 2) [rad/s] under conditions, so many ``together`` in a row under the same one.

    The size, (B, J), is that of trajectories that suit each condition.
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
    """Batches of a generator, each of their conditions drawn from a pool."""

    def __init__(self, generator: ConditionalGenerator, pool: Condition, settings: TrainingSettings) -> None:
        super().__init__()
        self.network, self.generator = generator.network, generator
        self.pool, self.settings = pool, settings
        constraints = generator.space.constraints
        self.quiet = Constraints(constraints.arm, constraints.regions, False, constraints.clearance)

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


def _losses(settings: TrainingSettings, body: RigidBody, usual: Tensor) -> list[LossTerm]:
    """Violation of constraints and conditions, and the information of the trajectories.

    That is the log condition number, and with an emphasis the log variance of the links that matter, of each
    base parameter in units of a usual one, (p,).
    """
    penalty, links = penalty_of(settings.reserve), body.base.columns // 10

    def violation(batch: ConditionedBatch) -> Tensor:
        return batch.problem.violation(batch.coefficients, penalty).mean()

    def information(batch: ConditionedBatch) -> Tensor:
        weights = batch.problem.condition.links[:, links] / usual
        ratio, variance = information_losses(batch.problem, batch.coefficients, weights)
        return ratio.mean() + settings.emphasis * variance.mean()

    return [Formula(settings.violation, violation, settings.ease), Formula(1.0, information)]


def train(
    space: ConditionSpace,
    settings: TrainingSettings,
    work: Path,
    seed: int,
    only: Condition | None = None,
    epoch_end: EpochEnd | None = None,
) -> Trained[ConditionalGenerator]:
    """A conditional generator of one arm; with ``only``, a dedicated one of that condition, a batch of one.

    An interrupted training goes on from the checkpoint in the folder ``work``.

    Raises:
        ConfigError: when nothing may be requested.
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
    terms = [
        *_losses(settings, body, usual),
        distance(settings.distance, distance_target(start, random=True)),
        rank(settings.rank, rank_target(start, settings.batch)),
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
    reach = Shaping.reach_of(space.constraints.arm, space.trajectory, start)
    return ConditionalGenerator(network, scaling, reach, space)


def _measure(sampler: ConditionSampler, seed: int, epoch: int) -> dict[str, float]:
    """True physics of a few trajectories under each of a few conditions."""
    settings, pool = sampler.settings, sampler.pool
    if not settings.evaluation:
        return {}
    random = torch.Generator().manual_seed(seed * 1_000_003 + epoch)
    rows = torch.randint(len(pool), (settings.evaluation,), generator=random)
    conditions = pool.take(rows)
    return outcome(sampler.generator, conditions, settings.together, random, settled=False).summary()
