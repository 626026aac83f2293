"""Settings of identification, as ``conf/`` has them."""

from dataclasses import dataclass
from typing import Annotated, Literal

from sidegan.base.typed import Bound, Count, Hertz, Positive
from sidegan.errors import ConfigError
from sidegan.identification.measurements import Noise


@dataclass(frozen=True)
class StudySettings:
    """Simulated measurements and recursive least squares: how excitation sets are executed and compared."""

    rate: Hertz  # of sampling [Hz]
    prior: Positive  # P₀ = prior · I
    forgetting: Annotated[float, Bound(">", 0), Bound("≤", 1)]
    weighted: bool  # also with one weight per joint, beside the paper's unweighted
    noise: Noise  # of the simulated measurements; test torques are free of it
    repeats: Count  # noise realisations
    tests: Count  # test trajectories


@dataclass(frozen=True)
class ReplicationSettings:
    """Whole sets measured with noise, the seeds several times over."""

    reading: str  # name of the reading of the paper's words about noise
    replicas: list[Count]  # how often the seeds are measured; one column of Table II for each
    noise: Noise  # of every measurement of the seeds
    generated: Noise  # of the measurements of generated trajectories
    repeats: Count

    def __post_init__(self) -> None:
        if not self.replicas or len(set(self.replicas)) < len(self.replicas):
            raise ConfigError(f"replicas is {self.replicas}, expected one number or more, each once")


@dataclass(frozen=True)
class Recursion:
    """Recursive least squares from P₀ = prior · I, in which a sample of age k counts forgetting^k."""

    prior: Positive
    forgetting: Annotated[float, Bound(">", 0), Bound("≤", 1)]


@dataclass(frozen=True)
class EstimationSettings:
    """How parameters are estimated from recordings."""

    method: Literal["ols", "weighted", "huber", "tls", "rls", "ridge", "essential"]
    settings: dict[str, float]  # of the method
    pull: Literal["logdet", "euclid"]
    strength: Positive | None  # of the pull; null: the most probable one
    margin: Positive
    total_mass: Positive | None  # [kg]
    library: str | None  # of trajectories to recommend from
    recommend: Count
