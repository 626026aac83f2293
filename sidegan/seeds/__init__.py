"""Conventional optimisers that make the seed set; the only door to pygmo."""

from sidegan.seeds.gradient import Gradient
from sidegan.seeds.make import Tasks, make_long, make_seeds, method_of
from sidegan.seeds.polish import Polish
from sidegan.seeds.problem import SeedProblem
from sidegan.seeds.result import SeedBatch

__all__ = ["Gradient", "Polish", "SeedBatch", "SeedProblem", "Tasks", "make_long", "make_seeds", "method_of"]
