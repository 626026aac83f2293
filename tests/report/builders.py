"""Coefficients, and an identified arm, to report on."""

from dataclasses import replace

import numpy as np

from tests.identification.recordings import checked, identified


def some(family, count):
    """Coefficients [rad/s], (count, J, H, 2)."""
    source = np.random.default_rng(count)
    return 0.3 * source.standard_normal((count, *family.shape))


def interrupted(made):
    """A recording that misses a second in the middle."""
    return replace(made, time=made.time + (np.arange(len(made.time)) >= len(made.time) // 2))


def identification(arm, first="a.csv", other="b.csv"):
    """An arm that is identified from one recording and validated on another."""
    training, validation = (checked(arm, seed, change=interrupted, rate=50) for seed in (0, 1))
    training = replace(training, statistics=replace(training.statistics, name=first))
    named = replace(validation.statistics, name=other)
    return identified(arm, [training], [replace(validation, role="validation", statistics=named)])
