"""Training of a conditioned generator: exact physics of batches under conditions drawn at random."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from sidegan.conditional.asking import Asking
from sidegan.conditional.condition import Condition
from sidegan.conditional.generator import ConditionalGenerator
from sidegan.conditional.measure import met
from sidegan.conditional.problem import ConditionedProblem, variances, worth
from sidegan.conditional.shaping import Shaping
from sidegan.design.penalty import Penalty
from sidegan.errors import ConfigError
from sidegan.gan.conditional import LoneLoop, fit
from sidegan.gan.exact import ExactPhysics
from sidegan.gan.limits import Limits
from sidegan.gan.training import random_trajectories
from sidegan.gan.variants import Exact, Variant, Weights
from sidegan.validity import Constraints

EpochEnd = Callable[[int, dict[str, float]], None]

_POOL = 20_000  # conditions drawn once, of which every step takes some
_CLEARANCE = 4.0  # times the reserve, in units of 0.25 m
_EASED = 0.67  # of a training, over which the weight of violations grows
_REFERENCE = 400  # random trajectories, whose median variance each parameter's is compared with


@dataclass(frozen=True)
class Settings:
    """How a conditioned generator is trained.

    Attributes:
        epochs: after each of which the true physics is measured.
        steps: per epoch.
        batch: trajectories per step.
        together: trajectories per condition in a batch, which are kept diverse.
        noise: dimension of the noise.
        width: of the network.
        learning_rate: of Adam, at the beginning.
        samples: time points per period.
        reserve: share of each torque limit, and four times that share of 0.25 m, that is kept free.
        ease: share of the violations' weight that they begin with.
        violation: weight of violations.
        emphasis: weight of the log variance of the links that matter, beside the log condition number.
        distance: weight of the mean distance.
        rank: weight of the effective rank.
        evaluation: conditions whose trajectories are checked after an epoch; 0: none.

    Raises:
        ConfigError: when a batch does not fall into groups of two or more.
    """

    epochs: int = 20
    steps: int = 100
    batch: int = 128
    together: int = 4
    noise: int = 84
    width: int = 512
    learning_rate: float = 2e-3
    samples: int = 40
    reserve: float = 0.05
    ease: float = 0.1
    violation: float = 1000.0
    emphasis: float = 8.0
    distance: float = 20.0
    rank: float = 20.0
    evaluation: int = 16

    def __post_init__(self) -> None:
        if self.together < 2 or self.batch % self.together:
            raise ConfigError(
                f"a batch of {self.batch} does not fall into groups of together={self.together} ≥ 2"
            )

    def variant(self, code: int) -> Variant:
        """The network and its schedule, as the variants' loop takes them."""
        weights = Weights(0.0, 0.0, self.violation, 1.0, 0.0, self.distance, self.rank)
        exact = Exact(samples=self.samples, reserve=self.reserve, ease=self.ease)
        return Variant(
            "conditional",
            weights=weights,
            epochs=self.epochs,
            steps=self.steps,
            batch=self.batch,
            generator_steps=1,
            noise=self.noise + code,
            width=self.width,
            learning_rate=self.learning_rate,
            activation="silu",
            limited=True,
            clip=10.0,
            exact=exact,
        )


@dataclass(frozen=True)
class Trained:
    """A trained generator and its metrics after every epoch."""

    generator: ConditionalGenerator
    history: list[dict[str, float]]


def train(
    asking: Asking,
    settings: Settings,
    work: Path,
    seed: int,
    only: Condition | None = None,
    epoch_end: EpochEnd | None = None,
) -> Trained:
    """A conditioned generator of one arm.

    Args:
        asking: the arm in its workspace, and what may be asked.
        settings: how it is trained.
        work: folder of the checkpoint from which an interrupted training goes on.
        seed: of weights, noise and conditions.
        only: the one condition of a dedicated generator, a batch of one; None: whatever may be asked.
        epoch_end: told (epoch, metrics) after every epoch.

    Raises:
        ConfigError: when nothing may be asked for, or the one condition is outside of the ranges.
        InfeasibleError: when the arm has no room at home under hardly any condition, or under the one.
        SideganError: when the training diverges.
    """
    torch.manual_seed(seed)
    if not asking.size:
        raise ConfigError("nothing may be asked for: give one range or more")
    if only is not None:
        asking.refuse(only)
    teacher = _Teacher(asking, settings, seed, only)
    variant = settings.variant(asking.size)
    constraints, trajectory = asking.constraints, asking.trajectory
    physics = ExactPhysics(constraints, trajectory, variant.exact or Exact())
    limits = Limits.of(constraints.arm, trajectory)
    steps = settings.epochs * settings.steps
    loop = LoneLoop(variant, teacher.start, steps, physics, limits, teacher.loss)
    fit(loop, work, teacher.measure, epoch_end)
    return Trained(teacher.generator(loop), loop.history)


class _Teacher:
    """What a batch under random conditions costs, and how well the conditions are met."""

    def __init__(self, asking: Asking, settings: Settings, seed: int, only: Condition | None) -> None:
        self.asking, self.settings, self.seed = asking, settings, seed
        known, trajectory = asking.constraints, asking.trajectory
        random = torch.Generator().manual_seed(seed)
        self.pool = only or asking.draw(_POOL, random)
        self.quiet = Constraints(known.arm, known.regions, torque=False)
        self.start = random_trajectories(known, trajectory, seed)
        self.shaping = Shaping(known.arm, trajectory, Shaping.reach_of(trajectory, self.start))
        self.links = known.body.base.columns // 10
        self.usual = self._usual(self.start[:_REFERENCE])
        reserve = settings.reserve
        self.penalty = Penalty(1.0, limits=0.0, torque=reserve, distance=_CLEARANCE * reserve)

    def _usual(self, c: Tensor) -> Tensor:
        """Median variance of each base parameter, (p,), over trajectories (N, J, H, 2)."""
        problem = self.problem(self.asking.neutral(len(c)))
        return variances(self.asking.constraints.body, problem.gram(c)).median(0).values

    def problem(self, condition: Condition) -> ConditionedProblem:
        """The trajectories under these conditions."""
        torque = self.asking.constraints.torque
        return ConditionedProblem(
            self.quiet,
            self.asking.trajectory,
            self.settings.samples,
            condition=condition,
            surroundings=self.asking.surroundings,
            torque=torque,
        )

    def loss(self, loop: LoneLoop, count: int, done: float) -> Tensor:
        """Loss of a batch, each of its conditions drawn from the pool; ``done`` of the training is over."""
        settings, together = self.settings, self.settings.together
        groups = torch.randint(len(self.pool), (count // together,))
        condition = self.pool.take(groups).repeat(together)
        noise = loop.generator.draw(len(condition))
        code = self.asking.encode(condition)
        images = loop.generator(torch.cat([noise[:, : settings.noise], code.to(noise)], 1))
        c = self.shaping(loop.scaling.coefficients(images), condition).double()
        problem = self.problem(condition)
        ratio, variance = worth(problem, c, condition.links[:, self.links] / self.usual)
        weight = settings.violation * settings.ease ** (1 - min(1.0, done / _EASED))
        loss = weight * problem.violation(c, self.penalty).mean()
        loss = loss + ratio.mean() + settings.emphasis * variance.mean()
        return loss + self._sameness(loop, c / self.shaping.size(condition)[:, :, None, None])

    def _sameness(self, loop: LoneLoop, x: Tensor) -> Tensor:
        """What a batch lacks in diversity within each condition; coefficients are all of one size."""
        groups = x.flatten(1).unflatten(0, (-1, self.settings.together))
        first, second = torch.triu_indices(groups.shape[1], groups.shape[1], 1)
        distance = (groups[:, first] - groups[:, second]).norm(dim=2).mean()
        residual = (groups - groups.mean(1, keepdim=True)).flatten(0, 1)
        missing = (1 - distance / loop.diversity.target).clamp_min(0)
        return self.settings.distance * missing + self.settings.rank * loop.diversity.rank_loss(residual)

    def generator(self, loop: LoneLoop) -> ConditionalGenerator:
        """What the loop has trained so far."""
        return ConditionalGenerator(loop.generator, loop.scaling, self.shaping.reach, self.asking)

    def measure(self, loop: LoneLoop, epoch: int) -> dict[str, float]:
        """True physics of a few trajectories under each of a few conditions."""
        if not self.settings.evaluation:
            return {}
        random = torch.Generator().manual_seed(self.seed * 1_000_003 + epoch)
        rows = torch.randint(len(self.pool), (self.settings.evaluation,), generator=random)
        found = met(self.generator(loop), self.pool.take(rows), self.settings.together, random, settled=False)
        return found.summary()
