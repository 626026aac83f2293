"""Independent random streams by purpose, derived from a run's seed."""

import numpy as np


def stream(seed: int, purpose: str, training: int | None = None) -> np.random.SeedSequence:
    """Random stream of a purpose, and of one of several trainings, independent of all others."""
    return np.random.SeedSequence([seed, *purpose.encode(), *([training] if training else [])])


def number(seed: int, purpose: str, training: int | None = None) -> int:
    """Random seed for a purpose, and for one of several trainings."""
    return int(stream(seed, purpose, training).generate_state(1)[0] & 0x7FFF_FFFF)
