"""Conventional optimisers that make the seed set; the only door to pygmo."""

from sidegan.seeding.gradient import Gradient
from sidegan.seeding.make import make_long, make_seeds
from sidegan.seeding.result import Optimiser, SeedBatch
from sidegan.seeding.settings import Long, Seeds, refuse_beyond

__all__ = ["Gradient", "Long", "Optimiser", "SeedBatch", "Seeds", "make_long", "make_seeds", "refuse_beyond"]
