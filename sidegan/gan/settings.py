"""Settings of the variants and of the surrogates that they learn from."""

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from sidegan.base.typed import Count, Natural, NonNegative, Part, Positive, Share, Size, Width
from sidegan.errors import ConfigError

_Ours = Literal["Vanilla", "Eigen", "Diagonal", "Predicting", "Exact"]
Name = Literal[_Ours, "PublishedVanilla", "PublishedEigen", "PublishedDiagonal"]
Beta = Annotated[float, Field(ge=0, lt=1)]
_SURROGATES = ("features", "success", "fitness")  # losses by surrogates


class Traits(NamedTuple):
    """What kind of variant a class is."""

    features: str | None = None  # that its converter predicts: a key of ``Labelled``
    seeded: bool = True  # whether it learns from a seed set, or from the arm and its workspace alone
    rewarded: bool = False  # whether for the prediction of torques
    published: bool = False  # whether by the recipe of the paper's authors
    missing: tuple[str, ...] = ()  # losses that it does not have


TRAITS: dict[Name, Traits] = {
    "Vanilla": Traits(missing=_SURROGATES),
    "Eigen": Traits("spectrum"),
    "Diagonal": Traits("diagonal"),
    "Predicting": Traits("energies", rewarded=True),
    "Exact": Traits(seeded=False, rewarded=True, missing=("adversarial", "features")),
    "PublishedVanilla": Traits(published=True, missing=_SURROGATES),
    "PublishedEigen": Traits("spectrum", published=True),
    "PublishedDiagonal": Traits("diagonal", published=True),
}


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Weights of the generator's losses, which are off unless a variant's file says otherwise.

    ``adversarial`` (D1), ``features`` (D2), ``success`` and ``fitness`` are the paper's. The others
    keep a batch as diverse as the seeds: ``distance`` on the average, ``rank`` in the number of directions
    from home, ``offset`` in what all have in common.
    """

    adversarial: NonNegative = 0.0
    features: NonNegative = 0.0
    success: NonNegative = 0.0
    fitness: NonNegative = 0.0
    distance: NonNegative = 0.0
    rank: NonNegative = 0.0
    offset: NonNegative = 0.0


@dataclass(frozen=True, kw_only=True)
class Refresh:
    """How surrogates go on learning from what the generator makes, before every epoch."""

    samples: Size = 600  # new ones, labelled by the true physics
    window: Count = 6  # epochs whose samples are learned from
    steps: Natural = 40  # of batches of 100
    learning_rate: Positive = 1e-3


@dataclass(frozen=True, kw_only=True)
class Reward:
    """What counts how much, of the errors of torques that models predict, by the noise of identification."""

    proportional: NonNegative = 1.0  # in proportion to the torque, as the paper has it, with equal weights
    constant: NonNegative = 2.0  # of a share of each joint's torque limit, by which the joints are weighted

    def __post_init__(self) -> None:
        if not self.proportional + self.constant:
            raise ConfigError("reward.proportional and reward.constant are 0, expected one of them above it")


@dataclass(frozen=True, kw_only=True)
class ExactPhysics:
    """Exact physics in place of the surrogates."""

    samples: Size = 36  # time points per period
    # For what happens between the time points; position and velocity limits hold anyway.
    reserve: Share = 0.05  # of each torque limit, and four times that share of 0.25 m as clearance


@dataclass(frozen=True, kw_only=True)
class Published:
    """Choices within the published recipe."""

    # Measure of the predicted features that is made small: their entropy as shares of their sum, by the code;
    # minus that, as the text wants them even; the ratio of the largest to the smallest, as printed.
    fitness: Literal["entropy", "minus_entropy", "ratio"] = "entropy"


@dataclass(frozen=True, kw_only=True)
class Variant:
    """A SIDE-GAN variant by its class, the weights of its losses, and how it is trained."""

    variant: Name
    weights: Weights
    epochs: Count = 50
    steps: Count | None = 18  # discriminator steps per epoch; null: as many as the seeds fill
    width: Width = 256  # of generator and discriminators
    noise: Width = 100  # dimension of the generator's noise
    batch: Annotated[int, Field(ge=2, le=10**5)] = 100
    generator_steps: Count = 2  # per discriminator step
    fitness_start: Natural = 10  # first epoch in which the fitness loss counts
    learning_rate: Positive = 2e-3
    warm_up: Share = 0.0  # share of the training over which the learning rate rises
    last_rate: Share = 0.02  # of the learning rate, to which it falls along half a cosine
    betas: tuple[Beta, Beta] = (0.5, 0.999)  # of Adam
    gaussian_start: bool = True  # the generator starts as the Gaussian with the seeds' mean and covariance
    limited: bool = True  # position and velocity limits hold by construction
    boxed: bool = True  # the box of the seeds' coefficients holds by construction, where they have one
    reserve: Share = 0.0  # of each limit, and of 0.1 m, that is kept free where the success predictor judges
    refresh: Refresh | None = None  # of our variants with surrogates; null: these stay as they were trained
    diversity: Part = 1.0  # share of the seeds' rank at which its floor lies
    corrections: Natural = 0  # networks that correct a trajectory by what it does over time
    exact: ExactPhysics | None = None  # of Exact
    reward: Reward | None = None  # of Exact and Predicting
    published: Published | None = None  # of the published ones

    def __post_init__(self) -> None:
        if foreign := [k for k in self.traits.missing if getattr(self.weights, k)]:
            names = ", ".join(f"weights.{name}" for name in foreign)
            raise ConfigError(f"{self.variant} has no such loss: {names} must be 0")
        if self.features and self.weights.fitness and self.fitness_start >= self.epochs:
            raise ConfigError(
                f"fitness_start {self.fitness_start} comes after the last of {self.epochs} epochs"
            )
        groups = {
            "exact": not self.traits.seeded,
            "reward": self.traits.rewarded,
            "published": self.traits.published,
        }
        for group, named in groups.items():
            if (getattr(self, group) is not None) != named:
                raise ConfigError(f"{self.variant} {'needs' if named else 'has no'} settings {group}")
        if self.refresh is not None and (self.published is not None or not self.features):
            raise ConfigError(f"{self.variant} has no surrogates to refresh: set refresh to null")
        for option in ("gaussian_start", "boxed", "corrections"):
            if self.published is not None and getattr(self, option):
                nothing = "0" if option == "corrections" else "false"
                raise ConfigError(f"the published networks have no {option}: set it to {nothing}")

    def rate(self, share: float) -> float:
        """Learning rate when a share of the training is done."""
        risen = min(1.0, share / self.warm_up) if self.warm_up else 1.0
        fallen = (1 - math.cos(math.pi * share)) / 2
        return self.learning_rate * risen * (1 + (self.last_rate - 1) * fallen)

    @property
    def traits(self) -> Traits:
        """What kind of variant it is."""
        return TRAITS[self.variant]

    @property
    def seeded(self) -> bool:
        """Whether the variant learns from a seed set, or from the arm and its workspace alone."""
        return self.traits.seeded

    @property
    def features(self) -> str | None:
        """Features that a converter predicts for the variant, which learns from a success predictor too."""
        return self.traits.features


_SIDE = Variant(
    variant="Eigen",
    weights=Weights(
        adversarial=0.3, features=0.3, success=150.0, fitness=60.0, distance=250.0, rank=200.0, offset=600.0
    ),
    fitness_start=0,  # a start as the seeds' Gaussian needs no time without it
    learning_rate=3e-3,
    warm_up=0.04,  # Adam's first steps are as large as any, and carry a whole batch into the box
    betas=(0.9, 0.99),  # the discriminators are one part among others
    reserve=0.03,
    refresh=Refresh(),
)
# Our variants by the names that ``conf/gan`` has for them too.
RECIPES: dict[str, Variant] = {
    "vanilla": Variant(variant="Vanilla", weights=Weights(adversarial=1.0), limited=False, last_rate=1.0),
    "eigen": _SIDE,
    "diagonal": replace(_SIDE, variant="Diagonal"),
    "prediction": replace(
        _SIDE,
        variant="Predicting",
        weights=replace(_SIDE.weights, fitness=30.0, rank=400.0),
        corrections=5,
        diversity=0.92,
        reward=Reward(),
    ),
    "exact": Variant(
        variant="Exact",
        weights=Weights(success=4000.0, fitness=6.0, distance=60.0, rank=150.0, offset=60.0),
        epochs=16,
        steps=60,
        batch=128,
        generator_steps=1,
        learning_rate=1e-3,
        last_rate=0.05,
        betas=(0.9, 0.99),  # no discriminator to follow
        diversity=0.8,
        corrections=5,
        exact=ExactPhysics(),
        reward=Reward(),
    ),
}


# The variant whose output surrogates learn from, by its name.
Negatives = Annotated[dict[str, Variant], Field(min_length=1, max_length=1)]


@dataclass(frozen=True, kw_only=True)
class SurrogateSettings:
    """How our success predictor and converters are trained, before any variant that learns from them."""

    recipe: Literal["ours"] = "ours"
    negatives: Negatives = field(default_factory=lambda: {"vanilla": RECIPES["vanilla"]})  # beside the seeds
    samples: Count = 12_000
    epochs: Count = 24
    width: Count = 128
    margin_steps: Count = 24  # time points per trajectory at which margins are predicted
    feature_steps: Count = 16  # time points per trajectory that the converter sees


@dataclass(frozen=True, kw_only=True)
class PublishedSurrogates:
    """How the surrogates that the paper's authors published are trained."""

    recipe: Literal["published"]
    negatives: Negatives  # for the predictor; converters learn from the seeds
    samples: Count  # of the predictor
    steps: Count  # of batches of 100
    shipped: bool  # the authors' weights from seeds.folder in place of a training


Surrogates = Annotated[SurrogateSettings | PublishedSurrogates, Field(discriminator="recipe")]
