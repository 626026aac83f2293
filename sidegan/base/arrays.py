"""Arrays as all rooms use them: NumPy's, float64 unless stated otherwise."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sidegan.errors import ShapeError

Array = np.ndarray[Any, np.dtype[Any]]

TINY = float(np.finfo(float).tiny)  # smallest normal number: keeps quotients and logarithms finite


def numbers(given: ArrayLike, name: str) -> Array:
    """What a user gives as numbers, in float64; a ShapeError that names it if they are not real numbers."""
    try:
        if np.iscomplexobj(given):  # NumPy would drop the imaginary parts
            raise TypeError("they are complex")
        return np.asarray(given, float)
    except (TypeError, ValueError, RuntimeError) as error:  # RuntimeError: of a tensor with gradients
        raise ShapeError(f"{name}: expected an array of numbers: {error}") from error


def flatten(x: Array, first: int) -> Array:
    """An array with its axes from ``first`` on merged."""
    return x.reshape(*x.shape[:first], math.prod(x.shape[first:]))


def split(x: Array, most: int) -> Iterator[Array]:
    """Parts of at most ``most`` rows; an empty array is a single part."""
    return (x[k : k + most] for k in range(0, max(1, len(x)), most))


def geometric_mean(x: Array) -> float:
    """Geometric mean of positive numbers."""
    return float(np.exp(np.log(x).mean()))
