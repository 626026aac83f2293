"""What distinguishes the SIDE-GAN variants: features, fitness and penalties; the training is shared."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from sidegan.base.typed import Count, Natural, NonNegative, Part, Positive, Share, Size, Width
from sidegan.design.objectives import Term
from sidegan.errors import ConfigError
from sidegan.gan.schedule import Schedule


@dataclass(frozen=True)
class Weights:
    """Weights of the terms of the generator's loss; a zero switches a term off.

    ``adversarial`` (D1), ``features`` (D2), ``success`` and ``fitness`` are the paper's. The others
    keep a batch as diverse as the seeds: ``distance`` on the average, ``rank`` in the number of directions.
    """

    adversarial: NonNegative
    features: NonNegative
    success: NonNegative
    fitness: NonNegative
    distance: NonNegative
    rank: NonNegative


@dataclass(frozen=True)
class Exact:
    """Exact physics in place of the surrogates."""

    terms: dict[str, Term]  # what weights.fitness weighs
    samples: Size  # time points per period
    # For what happens between the time points; position and velocity limits hold anyway.
    reserve: Share  # of each torque limit, and four times that share of 0.25 m as clearance
    ease: Part  # of weights.success, from which it grows

    def __post_init__(self) -> None:
        if not self.terms:
            raise ConfigError("terms is empty, expected one objective or more")


@dataclass(frozen=True)
class Published:
    """What may be varied of the published recipe."""

    # What the fitness loss makes small of the predicted features: their entropy as shares of their sum, by
    # the code; minus that, as the text wants them even; the ratio of the largest to the smallest, as printed.
    fitness: Literal["entropy", "minus_entropy", "ratio"]


@dataclass(frozen=True)
class Variant:
    """What one SIDE-GAN variant sees and is rewarded for, and how it is trained."""

    features: Literal["none", "spectrum", "diagonal"]  # what the second discriminator sees
    weights: Weights
    width: Width  # of generator and discriminators
    noise: Width  # dimension of the generator's noise
    epochs: Count
    steps: Count | None  # discriminator steps per epoch; null: as many as the seeds fill
    batch: Annotated[int, Field(ge=2, le=10**5)]
    generator_steps: Count  # per discriminator step
    fitness_start: Natural  # first epoch in which the fitness loss counts
    learning_rate: Positive
    betas: tuple[Share, Share]  # of Adam
    gaussian_start: bool  # the generator starts as the Gaussian with the seeds' mean and covariance
    # The kept epoch is the most exciting of those whose valid share, by true physics, is at least this share
    # of the best epoch's; null: the last one.
    least_valid: Share | None
    limited: bool  # position and velocity limits hold by construction
    exact: Exact | None  # exact physics in place of seeds, discriminators and surrogates; null: those
    published: Published | None  # the recipe as its authors published it, ``gan.published``; null: ours

    def __post_init__(self) -> None:
        if max(self.betas) >= 1:
            raise ConfigError(f"betas {self.betas} must be less than 1")
        if self.exact is None:
            self._check_seeded()
        else:
            self._check_exact(self.exact)
        if self.published is not None:
            self._check_published()

    def _check_seeded(self) -> None:
        if self.features == "none" and (self.weights.features or self.weights.fitness):
            raise ConfigError("weights.features and weights.fitness need features, which are none")
        if self.weights.fitness and self.fitness_start >= self.epochs:
            raise ConfigError(
                f"fitness_start {self.fitness_start} comes after the last of {self.epochs} epochs"
            )

    def _check_exact(self, exact: Exact) -> None:
        if self.features != "none" or self.weights.adversarial or self.weights.features:
            raise ConfigError(
                "exact physics has no discriminators: features must be none, and weights.adversarial and "
                "weights.features 0"
            )
        for term in exact.terms.values():
            if term.together > self.batch:
                raise ConfigError(
                    f"an objective is of {term.together} trajectories together, batch is {self.batch}"
                )

    def _check_published(self) -> None:
        ours = {
            "weights.distance": self.weights.distance,
            "weights.rank": self.weights.rank,
            "gaussian_start": self.gaussian_start,
            "limited": self.limited,
            "exact": self.exact,
        }
        if switched := [name for name, value in ours.items() if value]:
            raise ConfigError(
                f"the published recipe has none of {', '.join(switched)}; choose published or these"
            )

    @property
    def seeded(self) -> bool:
        """Whether the variant learns from a seed set, or from the arm and its workspace alone."""
        return self.exact is None

    @property
    def predicted(self) -> bool:
        """Whether the variant learns from a predictor of success or from a converter."""
        return self.seeded and (self.weights.success > 0 or self.features != "none")

    def schedule(self, seeds: int) -> Schedule:
        """Schedule of a training on so many seeds."""
        return Schedule(
            self.epochs,
            self.steps or -(-seeds // self.batch),
            self.batch,
            self.learning_rate,
            self.generator_steps,
            self.betas,
        )
