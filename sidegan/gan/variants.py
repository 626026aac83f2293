"""What distinguishes the SIDE-GAN variants: features, fitness and penalties; the loop is shared."""

from dataclasses import dataclass, field

from sidegan.design.objectives import Term
from sidegan.errors import ConfigError
from sidegan.gan.networks import ACTIVATIONS, BODIES

FEATURES = ("none", "spectrum", "diagonal")


@dataclass(frozen=True)
class Weights:
    """Weights of the generator's losses; a zero switches a part off.

    ``adversarial`` (D1), ``features`` (D2), ``success`` and ``fitness`` are the paper's. The others
    keep a batch as diverse as the seeds: ``spread`` in every direction of theirs, ``distance`` on the
    average, ``rank`` in the number of directions, whichever they are.
    """

    adversarial: float = 1.0
    features: float = 0.0
    success: float = 0.0
    fitness: float = 0.0
    spread: float = 0.0
    distance: float = 0.0
    rank: float = 0.0


@dataclass(frozen=True)
class Exact:
    """Exact physics in place of the surrogates.

    Attributes:
        terms: what ``weights.fitness`` weighs.
        samples: time points per period.
        reserve: share of each torque limit that is kept free, and four times that share of 0.25 m as
            clearance, for what happens between the time points. Position and velocity limits hold anyway.
        ease: the violation's weight begins at this share of ``weights.success`` and grows to all of it.
    """

    terms: tuple[Term, ...] = (Term("log_condition"),)
    samples: int = 40
    reserve: float = 0.03
    ease: float = 0.1

    def __post_init__(self) -> None:
        if not self.terms:
            raise ConfigError("exact physics needs one objective or more, got none")
        if not 0 < self.ease <= 1:
            raise ConfigError(f"ease is {self.ease}, expected a share above 0 and up to 1")


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
        activation: between the generator's layers, ``relu`` or ``silu``.
        limited: whether position and velocity limits hold by construction (``Limits``).
        clip: largest norm of the generator's gradient; None: any.
        exact: exact physics in place of the surrogates; None: surrogates.
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
    activation: str = "relu"
    limited: bool = False
    clip: float | None = None
    exact: Exact | None = None

    def __post_init__(self) -> None:
        if self.features not in FEATURES:
            raise ConfigError(
                f"features {self.features!r} of {self.name} must be one of {', '.join(FEATURES)}"
            )
        if self.body not in BODIES:
            raise ConfigError(f"body {self.body!r} of {self.name} must be one of {', '.join(BODIES)}")
        if self.activation not in ACTIVATIONS:
            raise ConfigError(
                f"activation {self.activation!r} of {self.name} must be one of {', '.join(ACTIVATIONS)}"
            )
        weighed = self.weights.features or (self.weights.fitness and self.exact is None)
        if self.features == "none" and weighed:
            raise ConfigError(f"{self.name} weighs features or fitness but predicts none: set its features")
        largest = max((term.together for term in self.exact.terms), default=1) if self.exact else 1
        if largest > self.batch:
            raise ConfigError(
                f"an objective of {self.name} is of {largest} trajectories, its batch {self.batch}"
            )
        for name in ("epochs", "batch", "generator_steps", "noise", "width"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} of {self.name} must be positive, got {getattr(self, name)}")
        if self.batch < 2:
            raise ConfigError(f"batch of {self.name} must be at least 2, got {self.batch}")
        if self.weights.fitness and self.exact is None and self.fitness_start >= self.epochs:
            raise ConfigError(
                f"fitness_start {self.fitness_start} of {self.name} comes after "
                f"its last epoch {self.epochs - 1}"
            )

    @property
    def surrogates(self) -> bool:
        """Whether the variant needs the success predictor or a converter."""
        return self.exact is None and (self.features != "none" or self.weights.success > 0)

    @property
    def seeded(self) -> bool:
        """Whether the variant learns from a seed set, or from the arm and its workspace alone."""
        return self.exact is None or self.weights.adversarial > 0 or self.weights.features > 0
