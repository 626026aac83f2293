"""Compiled kernels of the dynamics, chosen at import by what is installed."""
