"""What distinguishes the SIDE-GAN variants: features, fitness and penalties; the training is shared."""

from dataclasses import dataclass
from typing import Annotated, Literal

from sidegan.base.typed import Bound, Count, Natural, NonNegative, Positive, Share
from sidegan.design.objectives import Term
from sidegan.errors import ConfigError
from sidegan.gan.schedule import Schedule


@dataclass(frozen=True)
class Weights:
    """Weights of the terms of the generator's loss; a zero switches a term off.

    ``adversarial`` (D1), ``features`` (D2), ``success`` and ``fitness`` are the paper's. The others
    keep a batch as diverse as the seeds: ``spread`` in every direction of theirs, ``distance`` on the
    average, ``rank`` in the number of directions, whichever they are.
    """

    adversarial: NonNegative
    features: NonNegative
    success: NonNegative
    fitness: NonNegative
    spread: NonNegative
    distance: NonNegative
    rank: NonNegative


@dataclass(frozen=True)
class Exact:
    """Exact physics in place of the surrogates."""

    terms: dict[str, Term]  # what weights.fitness weighs
    samples: Count  # time points per period
    # For what happens between the time points; position and velocity limits hold anyway.
    reserve: Share  # of each torque limit, and four times that share of 0.25 m as clearance
    ease: Annotated[float, Bound(">", 0), Bound("≤", 1)]  # of weights.success, from which it grows

    def __post_init__(self) -> None:
        if not self.terms:
            raise ConfigError("terms is empty, expected one objective or more")


@dataclass(frozen=True)
class Variant:
    """What one SIDE-GAN variant sees and is rewarded for, and how it is trained."""

    features: Literal["none", "spectrum", "diagonal"]  # what the second discriminator sees
    weights: Weights
    body: Literal["conv", "mlp"]
    width: Count  # of generator and discriminators
    noise: Count  # dimension of the generator's noise
    epochs: Count
    steps: Count | None  # discriminator steps per epoch; null: as many as the seeds fill
    batch: Annotated[int, Bound("≥", 2)]
    generator_steps: Count  # per discriminator step
    fitness_start: Natural  # first epoch in which the fitness loss counts
    learning_rate: Positive
    critic_rate: Positive
    decay: bool  # both rates fall to nothing over the training, along a cosine
    gaussian_start: bool  # the generator starts as the Gaussian with the seeds' mean and covariance
    gradient_penalty: NonNegative  # R1 on the discriminators (Mescheder, Geiger, Nowozin 2018)
    data: Literal["broad", "paper"]  # its surrogates' samples: around seeds and negatives, or these alone
    minibatch: bool  # the discriminators see the spread of a batch
    scaling: Literal["joint", "range"]
    activation: Literal["relu", "silu"]  # between the generator's layers
    limited: bool  # position and velocity limits hold by construction
    clip: Positive | None  # largest norm of the generator's gradient; null: any
    exact: Exact | None  # exact physics in place of the surrogates; null: surrogates

    def __post_init__(self) -> None:
        predicted_fitness = self.weights.fitness and self.exact is None
        if self.features == "none" and (self.weights.features or predicted_fitness):
            raise ConfigError("weights.features and weights.fitness need features, which are none")
        if predicted_fitness and self.fitness_start >= self.epochs:
            raise ConfigError(
                f"fitness_start {self.fitness_start} comes after the last of {self.epochs} epochs"
            )
        for term in self.exact.terms.values() if self.exact else ():
            if term.together > self.batch:
                raise ConfigError(
                    f"an objective is of {term.together} trajectories together, batch is {self.batch}"
                )

    @property
    def surrogates(self) -> bool:
        """Whether the variant needs the success predictor or a converter."""
        return self.exact is None and (self.features != "none" or self.weights.success > 0)

    @property
    def seeded(self) -> bool:
        """Whether the variant learns from a seed set, or from the arm and its workspace alone."""
        return self.exact is None or self.weights.adversarial > 0 or self.weights.features > 0

    def schedule(self, seeds: int) -> Schedule:
        """Schedule of a training on so many seeds."""
        sizes = (self.epochs, self.steps or -(-seeds // self.batch), self.batch)
        rates = (self.learning_rate, self.critic_rate)
        return Schedule(*sizes, *rates, self.generator_steps, self.decay, self.clip)
