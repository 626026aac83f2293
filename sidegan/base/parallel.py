"""A few independent tasks at once, each in a process of its own with one thread, with progress.

joblib runs them in worker processes of this machine (loky), or a Dask cluster does. Which it is changes
nothing about what the tasks give back.
"""

import logging
import os
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sidegan.base.extras import extra
from sidegan.base.progress import bar
from sidegan.base.threads import one_thread
from sidegan.errors import ConfigError, SideganError, StorageError

if TYPE_CHECKING:
    from distributed import Client

_CONNECT = 15  # [s] for a Dask scheduler to answer
_WATCH = 1.0  # [s] between two looks at whether the parent process still lives

_client: "Client | None" = None  # of a Dask cluster; None: worker processes of this machine
_spent = 0.0  # CPU time of the jobs that this process had done by others [s]

Report = Callable[[int, int], None]  # tells that a job has done so many of so many steps
Job = Callable[[Report], Any]


@contextmanager
def on_cluster(scheduler: str | None) -> Iterator[None]:
    """Every ``run_jobs`` of this process uses a Dask cluster within the block; none: workers of this machine.

    Args:
        scheduler: address of the cluster, ``tcp://host:8786``.

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

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what went wrong comes as an error
    try:
        client = Client(scheduler, timeout=_CONNECT)
    except (OSError, ValueError) as error:
        raise SideganError(f"no Dask scheduler answers at {scheduler}: {error}") from error
    with client:
        crowded = [name for name, threads in client.nthreads().items() if threads > 1]
        if crowded:  # jobs set the threads of their whole process, so none may share one
            names = ", ".join(crowded[:3])
            raise ConfigError(f"Dask workers {names} run several threads; start them with --nthreads 1")
        _client = client
        try:
            yield
        finally:
            _client = None


def cores(workers: int | None) -> int:
    """Number of worker processes: ``workers``, or one per core that this process may use."""
    from joblib import cpu_count

    return workers or cpu_count()


def cpu_seconds() -> float:
    """CPU time of this process and of what ``run_jobs`` had done elsewhere, up to now."""
    return time.process_time() + _spent


def run_jobs(description: str, jobs: Sequence[Job], workers: int | None, total: int = 100) -> list[Any]:
    """Results of the jobs, in their order, the same wherever they run and whatever the number of workers.

    Args:
        description: what they do, for the progress bar and for the SideganError of workers that were lost.
        jobs: picklable functions that take a ``Report``, which only shows where a job runs here.
        workers: processes; None: one per core; with one of them jobs run here. A Dask cluster has its own.
        total: what the bar counts to, in whatever the jobs make together; percent by default.
    """
    global _spent
    most = min(cores(workers), len(jobs))
    with bar(description, total) as progress:

        def report_of(job: int) -> Report:
            return lambda done, steps: progress(round(total * (job + done / max(steps, 1)) / len(jobs)))

        if most < 2 and not (jobs and _client):
            with one_thread():
                return [job(report_of(number)) for number, job in enumerate(jobs)]
        results = []
        try:
            with closing(_by_dask(jobs, _client) if _client else _by_joblib(jobs, most)) as done:
                for number, (result, used) in enumerate(done):
                    _spent += used
                    results.append(result)
                    report_of(number)(1, 1)
        except Exception as error:
            if why := _lost(error):
                rest = "the same command continues where it stopped"
                raise SideganError(f"{description}: {why}; {rest}") from error
            raise
        return results


def _by_joblib(jobs: Sequence[Job], workers: int) -> Generator[tuple[Any, float], None, None]:
    from joblib import Parallel, delayed, parallel_config

    folder, ends = Path.cwd(), {"initializer": _leave_with, "initargs": (os.getpid(),)}
    with parallel_config("loky", inner_max_num_threads=1, **ends), warnings.catch_warnings():
        # Of workers that had grown and were replaced, and of cancelled tasks: nothing is lost by it.
        warnings.filterwarnings("ignore", module="joblib")
        parallel = Parallel(workers, return_as="generator", max_nbytes=None)
        yield from parallel(delayed(_work)(job, folder) for job in jobs)


def _by_dask(jobs: Sequence[Job], client: "Client") -> Generator[tuple[Any, float], None, None]:
    """Results by Dask itself: joblib's backend for it waits for ever where a worker was killed."""
    futures = client.map(_work, jobs, folder=Path.cwd(), pure=False)
    try:
        yield from (future.result() for future in futures)
    finally:
        client.cancel(futures)  # what has not begun, after an error


def _work(job: Job, folder: Path) -> tuple[Any, float]:
    """Result of a job in a worker, which goes to ``folder`` for relative paths, and its CPU time [s]."""
    began = time.process_time()
    try:
        os.chdir(folder)
    except OSError as error:
        host = os.uname().nodename
        raise StorageError(
            f"worker on {host} cannot read {folder} ({error.strerror}); put it on a shared file system"
        ) from error
    with one_thread():
        return job(lambda done, total: None), time.process_time() - began


def _leave_with(parent: int) -> None:
    """End this process soon after its parent, which may have been killed without a chance to tell."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _lost(error: Exception) -> str:
    """Why workers were lost for good; empty for an error of a job."""
    killed = "a worker process was killed, perhaps because it ran out of memory"
    if isinstance(error, BrokenProcessPool):
        return killed
    if _client is None:
        return ""
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        return f"{killed}, repeatedly"
    return "" if _client.status == "running" else "the Dask cluster went away"
