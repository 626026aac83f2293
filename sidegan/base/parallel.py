"""A few independent tasks at once, each in a process of its own with one thread, with progress."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sidegan.base.engines import ENGINES, Engine, Loky, Message, cores
from sidegan.base.progress import bar
from sidegan.base.threads import one_thread
from sidegan.errors import SideganError, StorageError

__all__ = ["Job", "Report", "cores", "cpu_seconds", "engine", "run_jobs"]

_POLL = 0.2  # [s]
_LEAST = 0.01  # share between two messages, each of which is a round trip to another process

_engine: Engine = Loky()
_elsewhere = 0.0  # CPU time of the jobs that this process had done by others [s]


Report = Callable[[int, int], None]  # tells that a job has done so many of so many steps
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


def cpu_seconds() -> float:
    """CPU time of this process and of what ``run_jobs`` had done elsewhere, up to now."""
    return time.process_time() + _elsewhere


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
    most = cores(workers)
    with bar(description, total) as progress:
        shares = [0.0] * len(jobs)

        def show(message: Message) -> None:
            job, share = message
            shares[job] = share
            progress(round(total * sum(shares) / len(shares)))

        if jobs and (_engine.remote or min(most, len(jobs)) > 1):
            return _run_elsewhere(description, jobs, most, show)
        with one_thread():
            return [job(_reporter(i, show)) for i, job in enumerate(jobs)]


def _reporter(job: int, send: Callable[[Message], None], least: float = 0.0) -> Report:
    """Sends how far a job is whenever that is ``least`` more than before."""
    last = [-1.0]

    def report(done: int, total: int) -> None:
        share = done / max(total, 1)
        if share - last[0] >= least or share >= 1:
            last[0] = share
            send((job, share))

    return report


def _run_elsewhere(
    description: str, jobs: Sequence[Job], workers: int, show: Callable[[Message], None]
) -> list[Any]:
    with _engine.pool(workers, len(jobs)) as pool:
        here = str(Path.cwd())
        futures: list[Future[Any]] = [
            pool.executor.submit(_work, job, i, pool.send, here) for i, job in enumerate(jobs)
        ]
        waiting = set(futures)
        while waiting:
            waiting = wait(waiting, timeout=_POLL).not_done
            for message in pool.messages():
                show(message)
        try:
            done = [future.result() for future in futures]
        except tuple(pool.lost) as error:
            why = next(words for kind, words in pool.lost.items() if isinstance(error, kind))
            raise SideganError(
                f"{description}: {why}; the same command again goes on where it was"
            ) from error
    global _elsewhere
    _elsewhere += sum(used for _, used in done)
    return [result for result, _ in done]


def _work(job: Job, index: int, send: Callable[[Message], None], folder: str) -> tuple[Any, float]:
    """Result of a job in a worker, where relative paths mean the same as here, and its CPU time [s]."""
    began = time.process_time()
    try:
        os.chdir(folder)
    except OSError as error:
        host = os.uname().nodename
        raise StorageError(
            f"worker on {host} does not see {folder} ({error.strerror}); put it on a shared file system"
        ) from error
    with one_thread():
        return job(_reporter(index, send, _LEAST)), time.process_time() - began
