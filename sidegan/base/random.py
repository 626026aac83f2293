"""Independent random streams by purpose, derived from a run's seed."""

import numpy as np

from sidegan.errors import ConfigError


def stream(seed: int, purpose: str, training: int | None = None) -> np.random.SeedSequence:
    """Random stream of a purpose, and of one of several trainings, independent of all others."""
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise ConfigError(f"seed is {seed!r}, expected a whole number ≥ 0")
    return np.random.SeedSequence([int(seed), *purpose.encode(), *([training] if training else [])])


def number(seed: int, purpose: str, training: int | None = None) -> int:
    """Random seed for a purpose, and for one of several trainings."""
    return int(stream(seed, purpose, training).generate_state(1)[0] & 0x7FFF_FFFF)
