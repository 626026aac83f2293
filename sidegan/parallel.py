"""A few independent tasks at once, each in a process of its own with one thread, with progress."""

import logging
import os
import queue
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager
from functools import partial
from typing import Any, Protocol

from sidegan.errors import SideganError
from sidegan.progress import bar

log = logging.getLogger(__name__)

_POLL = 0.2  # [s]
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Report(Protocol):
    """Tells how far a task is."""

    def __call__(self, done: int, total: int) -> None:
        """So many of so many steps are done."""


Job = Callable[[Report], Any]


def cores(workers: int | None) -> int:
    """Number of worker processes: ``workers``, or one per core that this process may use."""
    return workers or len(os.sched_getaffinity(0))


def run_jobs(description: str, jobs: Sequence[Job], workers: int | None, total: int = 100) -> list[Any]:
    """Results of the jobs, in their order, the same however many workers there are.

    Args:
        description: what they do, for the progress bar.
        jobs: picklable functions that take a ``Report``; with one worker they run here.
        workers: processes; None: one per core.
        total: what the bar counts to, in whatever the jobs make together; percent by default.

    Raises:
        SideganError: when a worker process dies; what jobs wrote to their work folders stays.
    """
    count = min(cores(workers), len(jobs))
    with bar(description, total) as one:
        shares = [0.0] * len(jobs)

        def told(job: int, share: float) -> None:
            shares[job] = share
            one(round(total * sum(shares) / len(shares)), total)

        if count <= 1:
            with _one_thread():
                return [job(_reporter(partial(told, i))) for i, job in enumerate(jobs)]
        return _run_processes(jobs, count, told)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Sums in the order in which a worker process would take them."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _reporter(tell: Callable[[float], None]) -> Report:
    def report(done: int, total: int) -> None:
        tell(done / max(total, 1))

    return report


def _run_processes(jobs: Sequence[Job], workers: int, told: Callable[[int, float], None]) -> list[Any]:
    from multiprocessing import Manager

    from joblib.externals.loky import get_reusable_executor
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    with Manager() as manager, warnings.catch_warnings():
        # Loky replaces a worker that has grown, and says so; nothing is lost by it.
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs")
        messages = manager.Queue()
        executor = get_reusable_executor(workers, timeout=600, env=dict.fromkeys(_THREADS, "1"))
        try:
            futures: list[Future[Any]] = [
                executor.submit(_work, job, i, messages) for i, job in enumerate(jobs)
            ]
            waiting = set(futures)
            while waiting:
                waiting = wait(waiting, timeout=_POLL).not_done
                _drain(messages, told)
            return [future.result() for future in futures]
        except TerminatedWorkerError as error:
            raise SideganError(
                "a worker process was killed; the same command again goes on where it was"
            ) from error
        except BaseException:
            executor.shutdown(wait=False, kill_workers=True)
            raise


def _drain(messages: Any, told: Callable[[int, float], None]) -> None:
    while True:
        try:
            told(*messages.get_nowait())
        except queue.Empty:
            return


def _work(job: Job, index: int, messages: Any) -> Any:
    last = [-1.0]

    def tell(share: float) -> None:
        if share - last[0] >= 0.01 or share >= 1:  # a message is a round trip to another process
            last[0] = share
            messages.put((index, share))

    with _one_thread():
        return job(_reporter(tell))
