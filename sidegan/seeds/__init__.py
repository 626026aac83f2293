"""Conventional optimisers that make the seed set; the only door to pygmo."""

from sidegan.seeds.make import make_long, make_seeds

__all__ = ["make_long", "make_seeds"]
