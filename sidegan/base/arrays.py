"""Arrays as all rooms use them: NumPy's, float64 unless stated otherwise."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


def flatten(x: Array, first: int) -> Array:
    """An array with its axes from ``first`` on merged."""
    return x.reshape(*x.shape[:first], math.prod(x.shape[first:]))


def split(x: Array, most: int) -> Iterator[Array]:
    """Parts of at most ``most`` rows; an empty array is a single part."""
    return (x[k : k + most] for k in range(0, max(1, len(x)), most))
