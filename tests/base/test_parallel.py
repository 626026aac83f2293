"""Jobs in processes: the same results whatever works on them, and no process or error is lost."""

import logging
import os
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path

import numpy as np
import psutil
import pytest
from threadpoolctl import threadpool_info

from sidegan.base import parallel
from sidegan.base.parallel import cpu_seconds, on_cluster, run_jobs, worker_count
from sidegan.base.threads import on_threads, threads
from sidegan.errors import ConfigError, InfeasibleError, SideganError, StorageError
from tests.refusals import refused
from tests.waiting import wait_until


def sums(seed, report):
    """Most threads of the process, its folder, and sums that depend on their order; takes some CPU time."""
    until = time.process_time() + 0.1
    while time.process_time() < until:
        a = np.random.default_rng(seed).standard_normal((300, 300))
    report(1, 2)
    most = max([threads(), *(pool["num_threads"] for pool in threadpool_info())])
    report(2, 2)
    return most, Path.cwd(), float((a @ a).sum()), float(np.linalg.cond(a))


def process(report):
    return os.getpid()


def die(report):
    os.kill(os.getpid(), 9)


@pytest.fixture(scope="module")
def dask():
    """A cluster of two workers on this machine, shared by the tests."""
    from distributed import LocalCluster

    options = {"memory_limit": 0, "silence_logs": logging.CRITICAL, "dashboard_address": ":0"}
    with LocalCluster(n_workers=2, threads_per_worker=1, **options) as cluster:
        yield cluster


@pytest.fixture(params=["here", "loky", "dask"])
def workers(request):
    """Number of workers: this process alone, or two of this machine or of a cluster."""
    if request.param != "dask":
        yield 1 if request.param == "here" else 2
        return
    with on_cluster(request.getfixturevalue("dask").scheduler_address):
        yield 2


@pytest.fixture
def steps(monkeypatch):
    """Every number of steps that the bar was told."""
    calls = []

    @contextmanager
    def bar(description, total):
        assert total == 100
        yield calls.append

    monkeypatch.setattr(parallel, "bar", bar)
    return calls


def test_results_progress_and_cpu_time_do_not_depend_on_the_workers(workers, steps, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jobs = [partial(sums, seed) for seed in (5, 3, 4)]
    with on_threads(2):
        here = run_jobs("sums", jobs, 1)
        assert threads() == 2
    before = cpu_seconds()
    steps.clear()
    assert run_jobs("sums", jobs, workers) == here and {row[:2] for row in here} == {(1, tmp_path)}
    assert steps == sorted(steps) and steps[-1] == 100 and cpu_seconds() - before >= 0.3
    assert (os.getpid() in run_jobs("processes", [process] * 2, workers)) == (workers == 1)


def test_empty_job_lists_and_empty_progress():
    assert run_jobs("none", [], 2) == []
    assert run_jobs("one", [lambda report: report(0, 0)], 2) == [None]
    assert worker_count(3) == 3 and 1 <= worker_count(None) <= (os.cpu_count() or 1)


def test_a_failing_job_raises_and_later_jobs_run(workers):
    error = InfeasibleError("never valid") if workers > 1 else ZeroDivisionError("a bug")

    def fail(report):
        raise error

    with pytest.raises(type(error), match=str(error)):
        run_jobs("failing", [process, fail], workers)
    assert len(run_jobs("after", [process, process], workers)) == 2


def test_a_killed_worker_is_reported():
    with refused(SideganError, "deadly"):
        run_jobs("deadly", [die, process], 2)
    assert len(run_jobs("after", [process, process], 2)) == 2


def test_an_interrupt_stops_the_workers_quietly(monkeypatch, recwarn):
    failed = []

    def nap(report):  # defined here, so that workers need not import what this file does
        time.sleep(0.2)

    @contextmanager
    def interrupted(*arguments):
        def progress(done):
            raise KeyboardInterrupt

        yield progress

    monkeypatch.setattr(threading, "excepthook", failed.append)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(parallel, "bar", interrupted)
        run_jobs("naps", [nap] * 50, 2)  # many more than workers take at a time
    assert run_jobs("after", [nap] * 3, 2) == [None] * 3
    assert not failed and not recwarn.list


def test_dask_retries_after_a_killed_worker_but_not_forever(dask, monkeypatch, tmp_path):
    marker = tmp_path / "died"

    def die_once(report):
        if not marker.exists():
            marker.touch()
            os.kill(os.getpid(), 9)
        return 7

    with on_cluster(dask.scheduler_address):
        assert run_jobs("killed", [die_once, process], 2)[0] == 7 and marker.exists()
        monkeypatch.setattr(dask.scheduler, "allowed_failures", 1)  # each costs a worker's start
        with refused(SideganError, "deadly"):
            run_jobs("deadly", [die, process], 2)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_cluster_is_given_by_its_scheduler_address(threads):
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": threads, "processes": False, "dashboard_address": ":0"}
    crowded = refused(ConfigError, "--nthreads 1") if threads > 1 else nullcontext()
    with distributed.LocalCluster(**options) as cluster, crowded, on_cluster(cluster.scheduler_address):
        # The cluster's workers are threads here: it was not run without them.
        assert run_jobs("one", [process], 1) == [os.getpid()]


def test_a_lost_cluster_is_reported(tmp_path):
    from distributed import LocalCluster

    begun = tmp_path / "begun"

    def begin(report):
        begun.touch()
        time.sleep(60)

    def end():
        wait_until(begun.exists)
        cluster.close()

    options = {"silence_logs": logging.CRITICAL, "dashboard_address": ":0"}
    with LocalCluster(n_workers=1, threads_per_worker=1, **options) as cluster:
        threading.Thread(target=end).start()
        with refused(SideganError, "long"), on_cluster(cluster.scheduler_address):
            run_jobs("long", [begin], None)


def test_unreachable_schedulers_and_unshared_folders_are_refused(monkeypatch):
    monkeypatch.setattr(parallel, "_CONNECT", 0.5)
    with refused(SideganError, "tcp://127.0.0.1:9"), on_cluster("tcp://127.0.0.1:9"):
        pass
    monkeypatch.setattr(parallel.Path, "cwd", lambda: "/no/such/folder")
    with refused(StorageError, "/no/such/folder"):
        run_jobs("far away", [process, process], 2)


def members(session):
    """Processes of a session that still run."""
    for other in psutil.process_iter():
        with suppress(OSError, psutil.Error):
            if os.getsid(other.pid) == session and other.status() != psutil.STATUS_ZOMBIE:
                yield other.pid


def test_workers_end_when_their_parent_is_killed(tmp_path):
    code = f"""
import os, time
from pathlib import Path
from sidegan.base.parallel import run_jobs
def note(report):
    Path({str(tmp_path)!r}, str(os.getpid())).touch()
    time.sleep(60)
if __name__ == "__main__":
    run_jobs("notes", [note, note], 2)
"""
    main = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    try:
        wait_until(lambda: len(list(tmp_path.iterdir())) == 2 and len([*members(main.pid)]) > 2)
    finally:
        main.kill()
        main.wait()
    wait_until(lambda: not [*members(main.pid)])
