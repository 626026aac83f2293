"""How kernels are compiled: once, then from a cache on disk.

Without reference counts (``_nrt``) they are twice as fast, and in return cannot allocate anything: whoever
calls one gives it room to work in.
"""

from collections.abc import Callable
from typing import Any

import numba

_OPTIONS: Any = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}


def jit(**options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Numba's compiler with its cache on disk, or without where there is no place for one."""
    every: Any = {**_OPTIONS, **options}

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        try:
            return numba.njit(cache=True, **every)(function)
        except RuntimeError:  # numba found no folder that it may write to
            return numba.njit(**every)(function)

    return decorate
