"""The part of the schema of ``conf/`` that is about identifying an arm from recordings."""

from dataclasses import dataclass
from typing import Literal

from sidegan.base.typed import Count, Positive
from sidegan.errors import ConfigError


@dataclass(frozen=True)
class Model:
    """What torque is explained with, beside rigid bodies."""

    rotor_inertia: bool
    viscous: bool
    coulomb: bool
    offset: bool
    stribeck: bool
    sign_width: Positive  # [rad/s or m/s]


@dataclass(frozen=True)
class Identify:
    """How parameters are found."""

    method: Literal["ols", "weighted", "huber", "tls", "rls", "ridge", "essential"]
    settings: dict[str, float]  # of the method
    pull: Literal["logdet", "euclid"]
    strength: Positive
    margin: Positive
    total_mass: Positive | None  # [kg]
    library: str | None  # of trajectories to recommend from
    recommend: Count


def check_files(recordings: list[str], validation: list[str]) -> None:
    """Refuse a recording that is named twice, or that a model would be validated on after training.

    Raises:
        ConfigError: naming the file.
    """
    for name, files in (("recordings", recordings), ("validation", validation)):
        twice = [file for file in files if files.count(file) > 1]
        if twice:
            raise ConfigError(f"{name} has {twice[0]} twice")
    both = [file for file in validation if file in recordings]
    if both:
        raise ConfigError(f"validation has {both[0]}, which is in recordings: it would not be held out")
