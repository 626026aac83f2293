"""Trajectory libraries: sample, filter, keep, save, load."""

from sidegan.library.collection import Library

__all__ = ["Library"]
