"""Compiled kernels; the only door to numba."""

HOPELESS = 1e12  # stands for an infinite condition number: optimisers take finite numbers only
# The smallest eigenvalue changes places with its neighbours all the time; a smooth minimum over a few
# spares the optimiser the kinks: 20 % lower condition numbers after as many steps.
LOWEST, HIGHEST, SHARPNESS = 3, 2, 6.0
