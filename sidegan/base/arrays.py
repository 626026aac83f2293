"""Arrays, as every room takes and returns them: NumPy's, float64 unless said otherwise."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


def flatten(x: Array, first: int) -> Array:
    """An array whose axes from ``first`` on are one."""
    return x.reshape(*x.shape[:first], math.prod(x.shape[first:]))


def split(x: Array, most: int) -> Iterator[Array]:
    """Parts of at most so many rows, one after another; of an empty array the array itself."""
    return (x[k : k + most] for k in range(0, max(1, len(x)), most))
