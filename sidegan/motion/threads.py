"""Work shared among threads: kernels, and eigenpairs."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.threads import threads

_AS_STATES = 50  # a small matrix is as much work as so many states
_WORTH_A_THREAD = 1_000  # states: half a millisecond of work


def threads_for(tasks: int, states: int) -> int:
    """How many threads so much work is worth."""
    return max(1, min(threads(), tasks, states // _WORTH_A_THREAD))


def share(work: Callable[[slice], None], batch: int, states: int) -> None:
    """Do work on slices of a batch, whose every item is as much work as so many states, one per thread."""
    threads = threads_for(batch, batch * states)
    cuts = [batch * k // threads for k in range(threads + 1)]
    each(lambda k: work(slice(cuts[k], cuts[k + 1])), threads)


def each(work: Callable[[int], None], count: int) -> None:
    """Do work 0, 1, … at the same time."""
    if count == 1:
        work(0)
    else:
        list(_pool(os.getpid(), count).map(work, range(count)))


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads that stay, of this process: a fork has none of its parent's."""
    return ThreadPoolExecutor(threads, "sidegan")


def eigh(x: Array) -> tuple[Array, Array]:
    """Eigenvalues (B, p), ascending, and eigenvectors (B, p, p) of symmetric matrices.

    LAPACK takes one matrix after the other; here threads share them.
    """
    values, vectors = np.empty(x.shape[:2]), np.empty_like(x)

    def work(k: slice) -> None:
        values[k], vectors[k] = np.linalg.eigh(x[k])

    share(work, len(x), _AS_STATES)
    return values, vectors
