"""Distribution of work among threads, and eigendecompositions on several threads."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.threads import threads

_AS_STATES = 50  # states that are as much work as a small matrix
_WORTH_A_THREAD = 1_000  # states, half a millisecond of work


def threads_for(tasks: int, states: int) -> int:
    """Number of threads worth using for this many tasks and states."""
    return max(1, min(threads(), tasks, states // _WORTH_A_THREAD))


def share(work: Callable[[slice], None], batch: int, states: int) -> None:
    """Run work on slices of a batch, one per thread; each item is as much work as ``states`` states."""
    threads = threads_for(batch, batch * states)
    cuts = [batch * k // threads for k in range(threads + 1)]
    each(lambda k: work(slice(cuts[k], cuts[k + 1])), threads)


def each(work: Callable[[int], None], count: int) -> None:
    """Run work 0, 1, … in parallel."""
    if count == 1:
        work(0)
    else:
        list(_pool(os.getpid(), count).map(work, range(count)))


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Persistent threads of this process; a fork does not inherit its parent's."""
    return ThreadPoolExecutor(threads, "sidegan")


def eigh(x: Array) -> tuple[Array, Array]:
    """Eigenvalues (B, p), ascending, and eigenvectors (B, p, p) of symmetric matrices, on several threads."""
    values = np.empty(x.shape[:2])
    vectors = np.empty_like(x)

    def work(k: slice) -> None:
        values[k], vectors[k] = np.linalg.eigh(x[k])

    share(work, len(x), _AS_STATES)
    return values, vectors
