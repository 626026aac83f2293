"""Conventional optimisers that make the seed set; the only door to pygmo."""

from sidegan.seeds.gradient import Gradient
from sidegan.seeds.make import Tasks, make_long, make_seeds
from sidegan.seeds.result import Optimiser, SeedBatch
from sidegan.seeds.settings import Long, Seeds

__all__ = ["Gradient", "Long", "Optimiser", "SeedBatch", "Seeds", "Tasks", "make_long", "make_seeds"]
