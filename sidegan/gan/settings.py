"""Settings of the variants and of their surrogates."""

import math
from dataclasses import asdict, dataclass
from pkgutil import resolve_name
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, Field

from sidegan.base.conf import chosen
from sidegan.base.typed import Count, Natural, NonNegative, Positive, PositiveShare, Share, Size, Width, build
from sidegan.errors import ConfigError

Beta = Annotated[float, Field(ge=0, lt=1)]
_VARIANTS = "sidegan.gan.variants"


class Traits(NamedTuple):
    """Properties of a variant's class that its settings depend on; importing the class itself needs torch."""

    features: str | None = None  # predicted by its converter: a field of ``Labelled``
    groups: tuple[str, ...] = ()  # of settings that only some variants have
    missing: tuple[str, ...] = ()  # losses that it does not have


TRAITS = {
    "Vanilla": Traits(missing=("features", "success", "fitness")),  # which use surrogates
    "Eigen": Traits("spectrum"),
    "Diagonal": Traits("diagonal"),
    "Predicting": Traits("energies", ("reward",)),
    "Exact": Traits(groups=("exact", "reward"), missing=("adversarial", "features")),
    "PublishedEigen": Traits("spectrum", ("published",)),
    "PublishedDiagonal": Traits("diagonal", ("published",)),
}


@dataclass(frozen=True, kw_only=True)
class TrainerSettings:
    """Arguments of Lightning's trainer: the device of the networks."""

    accelerator: Literal["cpu", "gpu", "cuda", "mps", "auto"] = "cpu"
    devices: int | list[int] = 1  # one, or the index of one

    def __post_init__(self) -> None:
        if self.devices != 1 and not (isinstance(self.devices, list) and len(self.devices) == 1):
            raise ConfigError(f"devices is {self.devices}, expected 1, or the index of one, [0]")


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Weights of the generator's losses, off by default.

    Each loss grows with what is said beside it. The first four are the paper's; the others keep a batch as
    diverse as the seeds.
    """

    adversarial: NonNegative = 0.0  # a discriminator (D1) tells trajectories from seeds
    features: NonNegative = 0.0  # another (D2) tells their predicted features from the seeds'
    success: NonNegative = 0.0  # trajectories are predicted to be invalid; Exact: violate constraints
    fitness: NonNegative = 0.0  # features are uneven; Predicting, Exact: sets predict torques badly
    distance: NonNegative = 0.0  # trajectories are closer to each other than seeds, in the mean
    rank: NonNegative = 0.0  # they span fewer directions than seeds
    offset: NonNegative = 0.0  # they have a motion in common, measured by their mean cosine


@dataclass(frozen=True, kw_only=True)
class Refresh:
    """Further training of surrogates on the generator's samples, before every epoch."""

    samples: Size = 300  # new samples, labelled by exact physics
    window: Count = 6  # number of recent epochs whose samples are used
    steps: Natural = 20  # batches of 100
    learning_rate: Positive = 1e-3  # of Adam


@dataclass(frozen=True, kw_only=True)
class Reward:
    """Weights of the prediction errors under two kinds of noise in the identification."""

    proportional: NonNegative = 1.0  # noise proportional to the torque, as in the paper; equal joint weights
    constant: NonNegative = 2.0  # noise of a share of each joint's torque limit, with joints weighted by it

    def __post_init__(self) -> None:
        if not self.proportional + self.constant:
            raise ConfigError("proportional and constant are both 0, expected one of them above 0")


@dataclass(frozen=True, kw_only=True)
class ExactPhysics:
    """Exact physics instead of surrogates."""

    samples: Size = 36  # time points per period
    # share of each torque limit, and four times that share of 0.25 m of clearance, to keep free, for what
    # happens between the time points; position and velocity limits hold by construction
    reserve: Share = 0.05


@dataclass(frozen=True, kw_only=True)
class Published:
    """Options of the published recipe."""

    # fitness loss of the predicted features: the entropy of their shares, as in the authors' code; its
    # negative, which makes them even as the text intends; the ratio of largest to smallest, as printed
    fitness: Literal["entropy", "minus_entropy", "ratio"] = "entropy"


@dataclass(frozen=True, kw_only=True)
class GeneratorSettings:
    """A generator and its optimiser: the same for all variants of a run, which differ by their losses."""

    # of generator and discriminators; convolutions see the published images, of 7 joints and 6 harmonics
    network: Literal["dense", "convolutional"] = "dense"
    width: Width = 256  # of hidden layers; of convolutions, channels of the last one
    noise: Width = 100  # dimension of the generator's noise
    gaussian_start: bool = True  # initialise to the seeds' mean and covariance
    limited: bool = True  # enforce limits on motion by construction
    boxed: bool = True  # enforce the box of the seeds' coefficients, if any, by construction
    corrections: Natural = 5  # networks that correct a trajectory given its roll-out
    penalty: NonNegative = 1.0  # of the discriminators' squared gradient at the seeds
    batch: Annotated[int, Field(ge=2, le=10**5)] = 100  # trajectories per step
    learning_rate: Positive = 1e-3  # the largest
    warm_up: Share = 0.04  # share of the training over which the learning rate rises
    last_rate: Share = 0.02  # final share of the learning rate, after a cosine decay
    betas: tuple[Beta, Beta] = (0.9, 0.99)  # of Adam

    def __post_init__(self) -> None:
        for option, nothing in (("gaussian_start", "false"), ("corrections", "0")):
            if self.network == "convolutional" and getattr(self, option):
                raise ConfigError(f"a convolutional generator has no {option}: set it to {nothing}")

    def rate(self, share: float) -> float:
        """Learning rate when a share of the training is done."""
        risen = min(1.0, share / self.warm_up) if self.warm_up else 1.0
        fallen = (1 - math.cos(math.pi * share)) / 2
        return self.learning_rate * risen * (1 + (self.last_rate - 1) * fallen)


@dataclass(frozen=True, kw_only=True)
class Variant:
    """A SIDE-GAN variant: its class, the weights of its losses, and its training."""

    _target_: str  # its class: one in ``sidegan.gan.variants``, or a subclass elsewhere
    weights: Weights = Weights()  # of the generator's losses
    generator: GeneratorSettings = GeneratorSettings()  # shared by the variants of a run
    epochs: Count  # of training; samples are measured by exact physics after each
    steps: Count | None  # discriminator steps per epoch; null: one pass over the seeds
    generator_steps: Count = 2  # per discriminator step
    fitness_start: Natural = 0  # first epoch with the fitness loss; Exact has it from the first on
    diversity: PositiveShare = 1.0  # lower bound of the rank, as a share of the seeds' rank
    reserve: Share = 0.0  # share of each limit, and of 0.1 m, that our success predictor keeps free
    refresh: Refresh | None = None  # only our variants with surrogates; null: surrogates stay frozen
    exact: ExactPhysics | None = None  # only Exact
    reward: Reward | None = None  # only Exact and Predicting
    published: Published | None = None  # only published variants

    def __post_init__(self) -> None:
        traits = self.traits
        if not isinstance(self.weights, Weights):
            raise ConfigError(f"weights are {self.weights!r}, expected Weights")
        if foreign := [f"weights.{name}" for name in traits.missing if getattr(self.weights, name)]:
            raise ConfigError(f"{self.name} has no such loss: {', '.join(foreign)} must be 0")
        start = self.fitness_start
        if self.features and self.weights.fitness and start >= self.epochs:
            raise ConfigError(f"fitness_start {start} comes after the last of {self.epochs} epochs")
        for group in ("exact", "reward", "published"):
            needed = group in traits.groups
            if (getattr(self, group) is not None) != needed:
                raise ConfigError(f"{self.name} {'needs' if needed else 'has no'} settings {group}")
        if self.refresh is not None and (self.published is not None or not self.features):
            raise ConfigError(f"{self.name} refreshes no surrogates: refresh must be null, None in Python")
        later = "fitness" if self.features and start else ""
        if not any(weight for name, weight in vars(self.weights).items() if name != later):
            raise ConfigError("no loss has a weight in the first epoch, expected one of weights above 0")

    @property
    def seeded(self) -> bool:
        """Whether the variant learns from a seed set, or only from the arm and its workspace."""
        return self.exact is None

    @property
    def features(self) -> str | None:
        """Features that the variant's converter predicts; None for a variant without surrogates."""
        return self.traits.features

    @property
    def name(self) -> str:
        """The class: a variant of this package by its name."""
        return self._target_.removeprefix(f"{_VARIANTS}.")

    @property
    def traits(self) -> Traits:
        """Properties of the class; a subclass elsewhere has those of the class it is made from."""
        module, _, name = self._target_.rpartition(".")
        if module == _VARIANTS and name in TRAITS:
            return TRAITS[name]
        why = ""
        try:
            for base in getattr(resolve_name(self._target_), "__mro__", ()):
                if base.__module__ == _VARIANTS and base.__name__ in TRAITS:
                    return TRAITS[base.__name__]
        except (ImportError, AttributeError, ValueError) as error:
            why = f": {error}"
        raise ConfigError(
            f"_target_ is {self._target_!r}, expected a subclass of one of {', '.join(TRAITS)} in "
            f"{_VARIANTS}{why}"
        )

    def stamped(self) -> dict[str, Any]:
        """Plain values that identify artifacts."""
        values = asdict(self)
        return {"variant": self.name, **{name: x for name, x in values.items() if name != "_target_"}}


def _untaught(negatives: dict[str, Variant]) -> dict[str, Variant]:
    """Refuse a variant that learns from surrogates itself."""
    for name, variant in negatives.items():
        if variant.features:
            raise ConfigError(f"{name} learns from surrogates itself, expected a variant such as vanilla")
    return negatives


# The variant whose samples surrogates learn from, under its name.
Negatives = Annotated[dict[str, Variant], Field(min_length=1, max_length=1), AfterValidator(_untaught)]


@dataclass(frozen=True, kw_only=True)
class SurrogateSettings:
    """Training of our success predictor and converters."""

    recipe: Literal["ours"] = "ours"  # the published one is for commands alone
    negatives: Negatives  # whose samples they learn from in addition to the seeds
    samples: Count  # that are labelled by exact physics
    epochs: Count  # of each network's training
    width: Count = 128  # of the networks
    margin_steps: Count = 24  # time points per trajectory for margins
    feature_steps: Count = 16  # time points per trajectory for the converter


@dataclass(frozen=True, kw_only=True)
class PublishedSurrogates:
    """Training of the surrogates by the recipe of the paper's authors."""

    recipe: Literal["published"]
    negatives: Negatives  # source of the predictor's samples; converters learn from the seeds
    samples: Count  # for the predictor
    steps: Count  # batches of 100
    shipped: bool  # use the authors' weights from seeds.folder instead of training


Surrogates = Annotated[SurrogateSettings | PublishedSurrogates, Field(discriminator="recipe")]


# Dataclasses whose defaults files in ``conf/`` begin with, by the names that they have there.
DEFAULTS = {
    "variant": Variant,
    "generator": GeneratorSettings,
    "refresh": Refresh,
    "reward": Reward,
    "exact_physics": ExactPhysics,
    "published": Published,
    "surrogates": SurrogateSettings,
}


def variant_recipe(name: str) -> Variant:
    """The variant that ``gan=name`` composes, at scale quick.

    Raises:
        ConfigError: when there is none.
    """
    found = chosen("gan", name, DEFAULTS, "defaults@gan.generator=generator")
    if name not in found:
        several = ", ".join(key for key in found if key != "generator")
        raise ConfigError(f"there is no variant {name!r}: gan={name} is {several}")
    return build(Variant, found[name])


def surrogates_recipe(**changes: Any) -> SurrogateSettings:
    """The surrogates that ``surrogates=default`` composes, at scale quick, with changed settings.

    Raises:
        ConfigError: when a setting is unknown or out of range; names it.
    """
    found = chosen("surrogates", "default", DEFAULTS)
    del found["negatives"]["generator"]  # which the variant has resolved
    return build(SurrogateSettings, found | changes)
