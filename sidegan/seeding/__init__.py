"""Conventional optimisers that make the seed set; the only door to pygmo."""

from sidegan.seeding.methods import Gradient
from sidegan.seeding.optimise import SeedBatch, make_long, make_seeds
from sidegan.seeding.settings import Seeds, refuse_beyond, seeds_recipe

__all__ = ["Gradient", "SeedBatch", "Seeds", "make_long", "make_seeds", "refuse_beyond", "seeds_recipe"]
