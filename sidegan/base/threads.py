"""Sums in the same order everywhere: torch, BLAS and OpenMP on one thread."""

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread() -> Iterator[None]:
    """Within the block this process works on one thread, so that no sum depends on the number of cores.

    What one process computes and hands to others is then what they would have computed themselves.
    """
    import torch
    from threadpoolctl import threadpool_limits

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        torch.set_num_threads(before)
