"""A few independent tasks at once, each in a process of its own with one thread, with progress."""

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from sidegan.base.engines import ENGINES, Engine, Loky, cores
from sidegan.base.progress import bar
from sidegan.errors import SideganError, StorageError

__all__ = ["Job", "Report", "cores", "engine", "run_jobs"]

log = logging.getLogger(__name__)

_POLL = 0.2  # [s]

_engine: Engine = Loky()


class Report(Protocol):
    """Tells how far a task is."""

    def __call__(self, done: int, total: int) -> None:
        """So many of so many steps are done."""


Job = Callable[[Report], Any]


@contextmanager
def engine(name: str, scheduler: str | None = None) -> Iterator[None]:
    """Every ``run_jobs`` of this process uses this engine within the block.

    Args:
        name: ``loky``, or ``dask``.
        scheduler: address of a Dask scheduler, ``tcp://host:8786``; None: a cluster on this machine.
    """
    global _engine
    before = _engine
    _engine = ENGINES[name](scheduler)
    try:
        yield
    finally:
        _engine.close()
        _engine = before


def run_jobs(description: str, jobs: Sequence[Job], workers: int | None, total: int = 100) -> list[Any]:
    """Results of the jobs, in their order, the same whatever the engine and the number of workers.

    Args:
        description: what they do, for the progress bar.
        jobs: picklable functions that take a ``Report``; with one worker they run here.
        workers: processes; None: one per core. A Dask cluster elsewhere has as many as it has.
        total: what the bar counts to, in whatever the jobs make together; percent by default.

    Raises:
        SideganError: when workers were lost for good; what jobs wrote to their work folders stays.
    """
    with bar(description, total) as one:
        shares = [0.0] * len(jobs)

        def told(job: int, share: float) -> None:
            shares[job] = share
            one(round(total * sum(shares) / len(shares)), total)

        if _engine.here(workers, len(jobs)):
            with _one_thread():
                return [job(_reporter(partial(told, i))) for i, job in enumerate(jobs)]
        return _run_elsewhere(_engine, description, jobs, workers, told)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Sums in the same order everywhere: torch, BLAS and OpenMP on one thread."""
    import torch
    from threadpoolctl import threadpool_limits

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        torch.set_num_threads(before)


def _reporter(tell: Callable[[float], None]) -> Report:
    def report(done: int, total: int) -> None:
        tell(done / max(total, 1))

    return report


def _run_elsewhere(
    on: Engine,
    description: str,
    jobs: Sequence[Job],
    workers: int | None,
    told: Callable[[int, float], None],
) -> list[Any]:
    with on.pool(workers, len(jobs)) as pool:
        here = str(Path.cwd())
        futures: list[Future[Any]] = [
            pool.executor.submit(_work, job, i, pool.tell, here) for i, job in enumerate(jobs)
        ]
        waiting = set(futures)
        while waiting:
            waiting = wait(waiting, timeout=_POLL).not_done
            for job, share in pool.heard():
                told(job, share)
        try:
            return [future.result() for future in futures]
        except tuple(pool.lost) as error:
            why = next(words for kind, words in pool.lost.items() if isinstance(error, kind))
            raise SideganError(
                f"{description}: {why}; the same command again goes on where it was"
            ) from error


def _work(job: Job, index: int, tell: Callable[[int, float], None], folder: str) -> Any:
    _enter(folder)
    last = [-1.0]

    def report(share: float) -> None:
        if share - last[0] >= 0.01 or share >= 1:  # a message is a round trip to another process
            last[0] = share
            tell(index, share)

    with _one_thread():
        return job(_reporter(report))


def _enter(folder: str) -> None:
    """Relative paths mean the same on every machine that sees the folder."""
    try:
        os.chdir(folder)
    except OSError as error:
        host = os.uname().nodename
        raise StorageError(
            f"worker on {host} does not see {folder} ({error.strerror}); put it on a shared file system"
        ) from error
