"""Number of threads, and work on several of them."""

import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from functools import cache

_count: list[int] = []  # stack of the enclosing blocks


def limited() -> bool:
    """Whether an enclosing block sets the number of threads."""
    return bool(_count)


def threads() -> int:
    """Number of threads to use: from the enclosing block, OMP_NUM_THREADS, or one per core."""
    return _count[-1] if _count else _usual()


@cache
def _usual() -> int:
    stated = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    if stated.isdigit() and int(stated):
        return int(stated)
    import joblib

    return int(joblib.cpu_count())


@contextmanager
def on_threads(count: int) -> Iterator[None]:
    """Set the number of threads of kernels, BLAS and, if loaded, torch within the block."""
    from threadpoolctl import threadpool_limits

    before = None
    _count.append(count)
    if torch := sys.modules.get("torch"):
        before = torch.get_num_threads()
        torch.set_num_threads(count)
    try:
        with threadpool_limits(count):
            yield
    finally:
        _count.pop()
        if torch := sys.modules.get("torch"):  # may have been loaded within the block
            torch.set_num_threads(before or threads())


def one_thread() -> AbstractContextManager[None]:
    """Use one thread within the block, so that no result depends on the number of cores."""
    return on_threads(1)


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
