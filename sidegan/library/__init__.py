"""Trajectory libraries: draw until enough are valid, measure, keep, save, load."""

from sidegan.library.collection import Library

__all__ = ["Library"]
