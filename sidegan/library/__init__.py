"""Trajectory libraries: draw valid trajectories, measure, save and load them."""

from sidegan.library.collection import LIBRARY, Library

__all__ = ["LIBRARY", "Library"]
