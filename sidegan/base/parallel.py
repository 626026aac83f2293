"""Parallel execution of independent tasks in single-threaded processes, with progress.

joblib runs them in worker processes of this machine (loky), or a Dask cluster does, with the same results.
"""

import logging
import os
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sidegan.base.extras import extra
from sidegan.base.names import listed
from sidegan.base.progress import bar
from sidegan.base.threads import one_thread
from sidegan.errors import ConfigError, SideganError, StorageError

if TYPE_CHECKING:
    from distributed import Client

_CONNECT = 15  # [s] timeout of a Dask scheduler
_WATCH = 1.0  # [s] between checks that the parent process is alive

_client: "Client | None" = None  # of a Dask cluster; None: worker processes of this machine
_spent = 0.0  # CPU time of this process's jobs in workers [s]

Report = Callable[[int, int], None]  # is called with the steps of a job that are done, and all of them
Job = Callable[[Report], Any]


@contextmanager
def on_cluster(scheduler: str | None) -> Iterator[None]:
    """Run all ``run_jobs`` of this process within the block on the Dask cluster of this scheduler's address.

    None: on this machine.

    Raises:
        SideganError: when the scheduler does not answer.
        ConfigError: when Dask is not installed, or a worker has several threads.
    """
    global _client
    if scheduler is None:
        yield
        return
    with extra("dask"):
        from distributed import Client

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # failures raise errors anyway
    try:
        client = Client(scheduler, timeout=_CONNECT)
    except (OSError, ValueError) as error:
        raise SideganError(f"no Dask scheduler answers at {scheduler}: {error}") from error
    with client:
        crowded = [name for name, threads in client.nthreads().items() if threads > 1]
        if crowded:  # jobs set their process's number of threads, so they cannot share a process
            raise ConfigError(
                f"Dask workers run several threads, start them with --nthreads 1: {listed(crowded, 3)}"
            )
        _client = client
        try:
            yield
        finally:
            _client = None


def worker_count(workers: int | None) -> int:
    """Number of worker processes: ``workers``, or one per core; ConfigError unless positive."""
    from joblib import cpu_count

    if workers is None:
        return cpu_count()
    if not isinstance(workers, Integral) or isinstance(workers, bool) or workers < 1:
        raise ConfigError(f"workers is {workers!r}, expected 1 or more, or None")
    return int(workers)


def cpu_seconds() -> float:
    """CPU time of this process and of its jobs in workers so far [s]."""
    return time.process_time() + _spent


def run_jobs(description: str, jobs: Sequence[Job], workers: int | None, total: int = 100) -> list[Any]:
    """Results of the jobs, in order, independent of where they run and of the number of workers.

    Args:
        description: of the jobs, for the progress bar and the SideganError if workers are lost.
        jobs: picklable functions of a ``Report``, which has no effect in workers.
        workers: number of processes; None: one per core; 1: run in this process. Ignored by a Dask cluster.
        total: what the bar counts to, such as the seeds that all jobs make; every job is an equal part of it.
    """
    global _spent
    processes = min(worker_count(workers), len(jobs))
    here = not jobs or (processes < 2 and _client is None)
    with bar(description, total) as progress:

        def report_of(job: int) -> Report:
            def report(done: int, steps: int) -> None:
                share = done / max(steps, 1)  # a job may have no steps
                progress(round(total * (job + share) / len(jobs)))

            return report

        if here:
            with one_thread():
                return [job(report_of(number)) for number, job in enumerate(jobs)]
        results = []
        try:
            with closing(_by_dask(jobs, _client) if _client else _by_joblib(jobs, processes)) as finished:
                for number, (result, used) in enumerate(finished):
                    _spent += used
                    results.append(result)
                    report_of(number)(1, 1)
        except Exception as error:
            if why := _reason_of_loss(error):
                rest = "run it again, which reuses all that was saved"
                raise SideganError(f"{description}: {why}; {rest}") from error
            raise
        return results


def _by_joblib(jobs: Sequence[Job], workers: int) -> Generator[tuple[Any, float], None, None]:
    """Results of the jobs, in order, each with its CPU time [s]."""
    from joblib import Parallel, delayed, parallel_config

    folder = Path.cwd()
    start = {"initializer": _exit_with, "initargs": (os.getpid(),)}
    with parallel_config("loky", inner_max_num_threads=1, **start), warnings.catch_warnings():
        # joblib warns of workers replaced for their memory, and of cancelled tasks; both are harmless
        warnings.filterwarnings("ignore", module="joblib")
        parallel = Parallel(workers, return_as="generator", max_nbytes=None)
        yield from parallel(delayed(_work)(job, folder) for job in jobs)


def _by_dask(jobs: Sequence[Job], client: "Client") -> Generator[tuple[Any, float], None, None]:
    """Results by Dask directly, since joblib's Dask backend hangs if a worker was killed."""
    futures = client.map(_work, jobs, folder=Path.cwd(), pure=False)
    try:
        yield from (future.result() for future in futures)
    finally:
        client.cancel(futures)  # pending ones, after an error


def _work(job: Job, folder: Path) -> tuple[Any, float]:
    """Result and CPU time [s] of a job in a worker, run in ``folder`` for relative paths."""
    began = time.process_time()
    try:
        os.chdir(folder)
    except OSError as error:
        host = os.uname().nodename
        raise StorageError(
            f"worker on {host} cannot read {folder} ({error.strerror}); put it on a shared file system"
        ) from error
    with one_thread():
        result = job(lambda done, steps: None)
    return result, time.process_time() - began


def _exit_with(parent: int) -> None:
    """End this process soon after its parent, which may be killed without notice."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH)
        os._exit(1)  # sys.exit would end this thread alone

    threading.Thread(target=watch, daemon=True).start()


def _reason_of_loss(error: Exception) -> str:
    """Why workers were lost; empty for an error in a job."""
    killed = "a worker process was killed, perhaps because it ran out of memory"
    if isinstance(error, BrokenProcessPool):
        return killed
    if type(error).__name__ == "KilledWorker":  # Dask's
        return f"{killed}, repeatedly"
    return "the Dask cluster went away" if _client and _client.status != "running" else ""
