"""Independent random streams by purpose, derived from a run's seed."""

import operator
from contextlib import suppress
from typing import Any

import numpy as np

from sidegan.errors import ConfigError


def seed_of(given: Any) -> int:
    """A random seed that a user gives, of any kind of whole number; a ConfigError for anything else."""
    with suppress(TypeError):  # of what is no whole number
        if (seed := operator.index(given)) >= 0:
            return seed
    raise ConfigError(f"seed is {given!r}, expected a whole number ≥ 0")


def stream(seed: int, purpose: str, training: int | None = None) -> np.random.SeedSequence:
    """Random stream of a purpose, and of one of several trainings, independent of all others."""
    return np.random.SeedSequence([seed_of(seed), *purpose.encode(), *([training] if training else [])])


def number(seed: int, purpose: str, training: int | None = None) -> int:
    """Random seed for a purpose, and for one of several trainings."""
    return int(stream(seed, purpose, training).generate_state(1)[0] & 0x7FFF_FFFF)
