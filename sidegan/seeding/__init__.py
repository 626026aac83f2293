"""Conventional optimisers that make the seed set; the only door to pygmo."""

from sidegan.seeding.gradient import Gradient
from sidegan.seeding.make import make_long, make_seeds
from sidegan.seeding.result import Optimiser, SeedBatch
from sidegan.seeding.settings import METHODS, Long, Seeds, refuse_beyond

__all__ = [
    "METHODS",
    "Gradient",
    "Long",
    "Optimiser",
    "SeedBatch",
    "Seeds",
    "make_long",
    "make_seeds",
    "refuse_beyond",
]
