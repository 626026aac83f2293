"""Settings of identification."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.typed import Count, Hertz, NonNegative, Number, Positive, PositiveShare, Seconds
from sidegan.errors import ConfigError
from sidegan.identification.measurements import Noise

_NOISE = 0.05  # default noise, as a share of a joint's usual torque


@dataclass(frozen=True, kw_only=True)
class StudySettings:
    """How excitation sets are measured in simulation and compared by recursive least squares."""

    rate: Hertz = 100.0  # sampling rate [Hz]
    prior: Positive = 1e6  # P₀ = prior · I
    noise: Noise = Noise()  # of the simulated measurements; test torques are exact
    # standard deviation of a constant noise, as real sensors have it, for a second set of expected errors: a
    # share of each joint's torque limit, or without one of its largest torque over random states
    constant: Positive = 0.01
    repeats: Count  # noise realisations
    tests: Count  # test trajectories
    reach: PositiveShare = 0.8  # share of its tightest limit that each test trajectory uses


# What is noisy: the seeds' measurements; all measurements; all torques; all torques and the seeds' states.
Reading = Literal["seeds", "all", "torques", "seeds_states"]


@dataclass(frozen=True, kw_only=True)
class ReplicationSettings:
    """Whole sets measured with noise, and the seeds measured repeatedly."""

    # readings of "each replication is done with 10% uniform random noise on both the robot state and on the
    # output torques"; tables II and III and the verdicts use the first
    readings: list[Reading] = field(default_factory=lambda: ["seeds"])
    # how often the seeds are measured; one column of Table II for each
    replicas: list[Count] = field(default_factory=lambda: [1, 4, 10])
    noise: Noise = Noise(state=True)  # of noisy measurements
    repeats: Count  # noise draws of the first reading
    others: Count = 3  # noise draws of every other reading, at most

    def __post_init__(self) -> None:
        for name in ("replicas", "readings"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise ConfigError(f"{name} is {values}, expected one or more, each once")

    def draws(self, reading: Reading) -> int:
        """Noise draws of a reading."""
        return self.repeats if reading == self.readings[0] else min(self.repeats, self.others)

    def of_seeds(self, reading: Reading) -> Noise:
        """Noise of the seeds' measurements."""
        return replace(self.noise, state=False) if reading == "torques" else self.noise

    def of_generated(self, reading: Reading) -> Noise:
        """Noise of the measurements of generated trajectories."""
        if reading == "seeds":
            return replace(self.noise, level=0.0, torque=False, state=False)
        return self.noise if reading == "all" else replace(self.noise, state=False)


@dataclass(frozen=True, kw_only=True)
class KnownLoad:
    """A known load, in the frame of the last moving link."""

    mass: NonNegative = 0.0  # [kg]
    centre: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)  # centre of mass [m]
    # inertia about the centre of mass [kg·m²]: Ixx, Ixy, Iyy, Ixz, Iyz, Izz; null: a point mass
    inertia: tuple[Number, Number, Number, Number, Number, Number] | None = None

    @property
    def parameters(self) -> Array:
        """The load's ten parameters in Pinocchio's order about the frame, (10,)."""
        if not self.mass > 0:
            raise ConfigError("load.mass is 0, expected the mass of the known load [kg]")
        c = np.array(self.centre)
        about = self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        moved = np.array(self.inertia or [0.0] * 6) + about[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
        return np.concatenate([[self.mass], self.mass * c, moved])


@dataclass(frozen=True, kw_only=True)
class GoalSettings:
    """Goal of a set of trajectories, and the noise of the sensors that measure it."""

    count: Count = 10  # trajectories
    # what to minimise: the variance of torques in other motions, of all parameters, of those of some links (a
    # list of names) or of a tool's parameters; or the condition number of the rigid-body regressor
    objective: Literal["prediction", "parameters", "payload", "condition"] | list[str] = "prediction"
    # standard deviation of measured torques: a share of each joint's usual torque, or a value per joint
    # [N·m or N]; null: that of the recordings if the arm was identified, else 5 %
    noise: Positive | list[Positive] | None = None
    correlation: Seconds = 0.03  # correlation time of the noise

    def deviation(self, usual: Array) -> Array:
        """Standard deviation of each joint's measured torque, (J,), from its usual torque [N·m or N]."""
        if not isinstance(self.noise, list):
            return (self.noise or _NOISE) * usual
        if len(self.noise) != len(usual):
            raise ConfigError(f"goal.noise has {len(self.noise)} numbers, the arm has {len(usual)} joints")
        return np.array(self.noise, float)

    @property
    def rate(self) -> float:
        """Rate of samples with independent noise [Hz]."""
        return 1 / (2 * self.correlation)


@dataclass(frozen=True, kw_only=True)
class EstimationSettings:
    """Estimation of parameters from recordings."""

    method: Literal["ols", "weighted"] = "weighted"
    strength: Positive | None = None  # of the pull towards the description; null: the most probable strength
