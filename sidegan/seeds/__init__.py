"""Conventional optimisers that make the seed set; the only door to pygmo."""

from sidegan.seeds.gradient import Gradient
from sidegan.seeds.make import Tasks, make_long, make_seeds, method_of
from sidegan.seeds.result import SeedBatch

__all__ = ["Gradient", "SeedBatch", "Tasks", "make_long", "make_seeds", "method_of"]
