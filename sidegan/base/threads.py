"""How many threads work is shared among."""

import os
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cache

_count: list[int] = []  # of the blocks that we are in


def limited() -> bool:
    """Whether this is within a block that says how many threads there are."""
    return bool(_count)


def threads() -> int:
    """How many threads work may be shared among: as OMP_NUM_THREADS says, or one per core."""
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
    """Within the block kernels, BLAS and, where it is loaded, torch work on so many threads."""
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
        if torch := sys.modules.get("torch"):  # perhaps loaded within the block
            torch.set_num_threads(before or threads())


def one_thread() -> AbstractContextManager[None]:
    """Within the block no sum depends on the number of cores.

    What one process computes and hands to others is then what they would have computed themselves.
    """
    return on_threads(1)
