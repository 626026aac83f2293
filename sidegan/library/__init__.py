"""Trajectory libraries: draw until enough are valid, measure, keep, save, load."""

from sidegan.library.collection import LIBRARY, Library

__all__ = ["LIBRARY", "Library"]
