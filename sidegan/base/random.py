"""Streams of random numbers, one for each purpose, which all follow from the seed of a run."""

import numpy as np


def stream(seed: int, purpose: str, training: int | None = None) -> np.random.SeedSequence:
    """The random numbers of one purpose, and of one of several trainings, independent of all others."""
    return np.random.SeedSequence([seed, *purpose.encode(), *([training] if training else [])])


def number(seed: int, purpose: str, training: int | None = None) -> int:
    """One random seed for a purpose, and for one of several trainings."""
    return int(stream(seed, purpose, training).generate_state(1)[0] & 0x7FFF_FFFF)
