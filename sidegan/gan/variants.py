"""What distinguishes the SIDE-GAN variants: features, fitness and penalties; the loop is shared."""

from dataclasses import dataclass, field

from sidegan.errors import ConfigError
from sidegan.gan.networks import BODIES

FEATURES = ("none", "spectrum", "diagonal")


@dataclass(frozen=True)
class Weights:
    """Weights of the generator's losses; a zero switches a part off.

    ``adversarial`` (D1), ``features`` (D2), ``success`` and ``fitness`` are the paper's. The other two
    keep a batch as diverse as the seeds: ``spread`` in every direction, ``distance`` on the average.
    """

    adversarial: float = 1.0
    features: float = 0.0
    success: float = 0.0
    fitness: float = 0.0
    spread: float = 0.0
    distance: float = 0.0


@dataclass(frozen=True)
class Variant:
    """A SIDE-GAN variant and its schedule.

    Attributes:
        name: what it is called in tables.
        features: what the converter predicts and the second discriminator sees: ``none``,
            ``spectrum`` or ``diagonal``.
        weights: weights of the losses.
        epochs: passes over the seeds.
        steps: discriminator steps per epoch; the seeds' number over the batch when None.
        batch: trajectories per step.
        generator_steps: generator steps per discriminator step.
        fitness_start: first epoch in which the fitness loss counts.
        noise: dimension of the generator's noise.
        body: ``conv`` or ``mlp``.
        width: width of generator and discriminators.
        learning_rate: of the generator's Adam.
        critic_rate: of the discriminators' Adam.
        decay: whether both rates fall to nothing over the training, along a cosine.
        gaussian_start: whether the generator starts as the Gaussian with the seeds' mean and covariance,
            through a linear path beside its layers.
        gradient_penalty: weight of the R1 penalty (Mescheder, Geiger, Nowozin 2018) on D1 and D2.
        minibatch: whether discriminators see the spread of a batch.
        scaling: ``joint`` or ``range`` (``Scaling.fit``).
    """

    name: str
    features: str = "none"
    weights: Weights = field(default_factory=Weights)
    epochs: int = 50
    steps: int | None = None
    batch: int = 100
    generator_steps: int = 2
    fitness_start: int = 10
    noise: int = 100
    body: str = "mlp"
    width: int = 256
    learning_rate: float = 3e-3
    critic_rate: float = 2e-3
    decay: bool = True
    gaussian_start: bool = True
    gradient_penalty: float = 1.0
    minibatch: bool = True
    scaling: str = "joint"

    def __post_init__(self) -> None:
        if self.features not in FEATURES:
            raise ConfigError(
                f"features {self.features!r} of {self.name} must be one of {', '.join(FEATURES)}"
            )
        if self.body not in BODIES:
            raise ConfigError(f"body {self.body!r} of {self.name} must be one of {', '.join(BODIES)}")
        if self.features == "none" and (self.weights.features or self.weights.fitness):
            raise ConfigError(f"{self.name} weighs features or fitness but predicts none: set its features")
        for name in ("epochs", "batch", "generator_steps", "noise", "width"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} of {self.name} must be positive, got {getattr(self, name)}")
        if self.batch < 2:
            raise ConfigError(f"batch of {self.name} must be at least 2, got {self.batch}")
        if self.weights.fitness and self.fitness_start >= self.epochs:
            raise ConfigError(
                f"fitness_start {self.fitness_start} of {self.name} comes after "
                f"its last epoch {self.epochs - 1}"
            )

    @property
    def surrogates(self) -> bool:
        """Whether the variant needs the success predictor or a converter."""
        return self.features != "none" or self.weights.success > 0
