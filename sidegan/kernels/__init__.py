"""Compiled kernels; the only door to numba."""

HOPELESS = 1e12  # stands for an infinite condition number: optimisers take finite numbers only
