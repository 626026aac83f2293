"""Where jobs run: in worker processes of this machine (loky), or on a Dask cluster.

An engine opens a ``Pool``: something to submit functions to, and a way for them to tell how far they are. Its
workers are released, and on an error stopped, at the end of the block. Which engine it is changes nothing
about what the functions give back; a ``remote`` one is elsewhere, so that even a single job goes there.
"""

import logging
import os
import queue
import signal
import threading
import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sidegan.errors import ConfigError, SideganError

if TYPE_CHECKING:
    from distributed import Client

# NumPy and torch read these when they are imported. Threads that wait must not keep a core busy.
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OMP_WAIT_POLICY": "PASSIVE",
}

_IDLE = 600  # [s] after which an unused loky worker ends
_CONNECT = 15  # [s] for a Dask scheduler to answer
_WATCH = 1.0  # [s] between two looks at whether the parent process still lives
_SEMAPHORES = Path("/dev/shm")  # where Linux shows them
_KILLED = "a worker process was killed, perhaps for want of memory"

Message = tuple[int, float]  # number of a job, and its share that is done


class Pool(NamedTuple):
    """Workers that are ready."""

    executor: Executor  # takes functions
    send: Callable[[Message], None]  # picklable; sends a message from a worker
    messages: Callable[[], list[Message]]  # those since the last call
    # what waiting for a result raises when workers were lost for good, and what that means
    lost: dict[type[BaseException], str]


def cores(workers: int | None) -> int:
    """Number of worker processes: ``workers``, or one per core that this process may use."""
    return workers or len(os.sched_getaffinity(0))


class Loky:
    """Worker processes of this machine, kept between calls."""

    remote = False

    @contextmanager
    def pool(self, workers: int, jobs: int) -> Iterator[Pool]:
        """As many workers as there are jobs, at most ``workers``."""
        from multiprocessing.managers import SyncManager

        from joblib.externals.loky import get_reusable_executor
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        _sweep(_SEMAPHORES)
        # At a port of this machine, with a key: a socket in a folder would be left by whoever is killed.
        manager, watch = SyncManager(("127.0.0.1", 0)), (os.getpid(),)
        manager.start(leave_with, watch)
        with manager, warnings.catch_warnings():
            # Loky replaces a worker that has grown, and says so; nothing is lost by it.
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs")
            messages = manager.Queue()
            executor = get_reusable_executor(
                min(workers, jobs), timeout=_IDLE, env=ONE_THREAD, initializer=leave_with, initargs=watch
            )
            try:
                lost: dict[type[BaseException], str] = {TerminatedWorkerError: _KILLED}
                yield Pool(executor, messages.put, partial(_drain, messages), lost)
            except BaseException:
                _kill(executor)
                raise

    def close(self) -> None:
        """Nothing: idle workers end by themselves."""


class Dask:
    """A Dask cluster, which finishes what a lost worker began on another one.

    Args:
        address: of its scheduler; None: a cluster on this machine, started when it is first needed.
    """

    def __init__(self, address: str | None = None) -> None:
        self.address, self.remote = address, address is not None
        self._held = ExitStack()
        self._client: Client | None = None

    @contextmanager
    def pool(self, workers: int, jobs: int) -> Iterator[Pool]:
        """Every worker of the cluster; of a cluster on this machine, ``workers``."""
        from distributed import CancelledError, KilledWorker

        client = self._client = self._client or self._connect(workers)
        _refuse_threads(client)
        messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        topic = f"sidegan-{uuid.uuid4().hex}"
        client.subscribe_topic(topic, lambda event: messages.put(tuple(event[1])))
        executor = client.get_executor(pure=False)
        try:
            lost = {KilledWorker: f"{_KILLED}, time and again", CancelledError: "the Dask cluster went away"}
            yield Pool(executor, partial(_log_event, topic), partial(_drain, messages), lost)
        except BaseException:
            executor.shutdown(wait=False)  # cancels what has not begun
            raise
        finally:
            client.unsubscribe_topic(topic)

    def close(self) -> None:
        """Leave the cluster; one that was started here ends."""
        self._client = None
        self._held.close()

    def _connect(self, workers: int) -> "Client":
        from distributed import Client, LocalCluster

        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what went wrong comes as an error
        if self.address is None:
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                memory_limit=0,
                dashboard_address=None,
                scheduler_kwargs={"dashboard_address": ":0"},  # its HTTP server, else at a fixed port
                silence_logs=logging.CRITICAL,
                env=ONE_THREAD,
                preload=[__name__],
            )
            self._held.enter_context(cluster)
            return self._held.enter_context(Client(cluster))
        try:
            return self._held.enter_context(Client(self.address, timeout=_CONNECT))
        except (OSError, ValueError) as error:
            raise SideganError(f"no Dask scheduler answers at {self.address}: {error}") from error


Engine = Loky | Dask
ENGINES: dict[str, Callable[[str | None], Engine]] = {"loky": lambda scheduler: Loky(), "dask": Dask}


def dask_setup(worker: Any) -> None:
    """Dask calls this in each worker of a cluster here: the keyboard interrupts the main process alone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def leave_with(parent: int) -> None:
    """End this process soon after its parent, which may have been killed without a chance to tell."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _sweep(folder: Path) -> None:
    """Remove the semaphores of loky's whose process was killed together with all of its helpers."""
    for path in folder.glob("sem.loky-*"):
        _, owner, *_ = path.name.split("-")
        if owner.isdigit() and not Path("/proc", owner).exists():
            with suppress(OSError):  # another user's, or gone already
                path.unlink()


def _kill(executor: Any) -> None:
    """End loky's workers at once.

    Its thread throws away what nobody has begun, then looks for the next of these and dies of a KeyError. So
    their numbers are taken from its list first, and nothing is left to look for.
    """
    with suppress(queue.Empty):
        while True:
            executor._work_ids.get_nowait()
    executor.shutdown(wait=False, kill_workers=True)


def _refuse_threads(client: "Client") -> None:
    """Jobs set the threads of their whole process, so none may share one."""
    crowded = [name for name, threads in client.nthreads().items() if threads > 1]
    if crowded:
        raise ConfigError(
            f"Dask workers {', '.join(crowded[:3])} run several threads; start them with --nthreads 1"
        )


def _log_event(topic: str, message: Message) -> None:
    from distributed import get_worker

    get_worker().log_event(topic, message)


def _drain(messages: Any) -> list[Message]:
    drained: list[Message] = []
    with suppress(queue.Empty):
        while True:
            drained.append(messages.get_nowait())
    return drained
