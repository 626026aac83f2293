"""Compiled kernels; the only door to numba."""
