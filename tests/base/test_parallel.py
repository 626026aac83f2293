import json
import logging
import os
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
import torch

from sidegan.base import parallel
from sidegan.base.engines import ONE_THREAD, Dask, Loky, _sweep
from sidegan.base.parallel import cores, cpu_seconds, engine, run_jobs
from sidegan.errors import ConfigError, InfeasibleError, SideganError, StorageError


def square(x, report):
    for step in range(10):
        report(step + 1, 10)
    return x * x, os.getpid()


def burn(seconds, report):
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass


def fail(error, report):
    raise error


def die(report):
    os.kill(os.getpid(), 9)


def die_once(marker, report):
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), 9)
    return 7


def slow(seconds, report):
    time.sleep(seconds)
    return seconds


def begin(marker, report):
    marker.touch()
    time.sleep(60)


def threads_and_sums(seed, report):
    """Every thread setting of the process, and sums that depend on their order."""
    import numpy as np
    from threadpoolctl import threadpool_info

    generator = torch.Generator().manual_seed(seed)
    a = torch.randn(300, 300, generator=generator)
    most = max([torch.get_num_threads(), *(pool["num_threads"] for pool in threadpool_info())])
    return most, float((a @ a).sum()), float(np.linalg.cond(a.double().numpy()))


def settings(report):
    return {key: os.environ.get(key) for key in ONE_THREAD}, Path.cwd(), os.getpid()


@pytest.fixture(scope="module")
def dask():
    """A cluster of two workers on this machine, shared by the tests."""
    pytest.importorskip("distributed")
    one = Dask()
    yield one
    one.close()


@pytest.fixture(params=["loky", "dask"])
def two_workers(request, monkeypatch):
    """Two workers of each engine."""
    chosen = Loky() if request.param == "loky" else request.getfixturevalue("dask")
    monkeypatch.setattr(parallel, "_engine", chosen)
    return request.param


@pytest.fixture
def told(monkeypatch):
    """Every number of steps that the bar was told."""
    calls = []

    @contextmanager
    def bar(description, total):
        assert total == 100
        yield calls.append

    monkeypatch.setattr(parallel, "bar", bar)
    return calls


@pytest.mark.parametrize("workers", [1, 2])
def test_results_are_in_order_and_progress_reaches_the_end(workers, told):
    results = run_jobs("squares", [partial(square, x) for x in (5, 3, 4)], workers)
    assert [value for value, _ in results] == [25, 9, 16]
    assert ({pid for _, pid in results} == {os.getpid()}) == (workers == 1)
    assert told == sorted(told) and told[-1] == 100


def test_every_engine_gives_the_same_and_tells_how_far_it_is(two_workers, told):
    results = run_jobs("squares", [partial(square, x) for x in (5, 3, 4)], 2)
    assert [value for value, _ in results] == [25, 9, 16]
    assert os.getpid() not in {pid for _, pid in results}
    assert told == sorted(told) and told[-1] == 100


def test_results_are_the_same_to_the_last_bit(two_workers):
    jobs = [partial(threads_and_sums, seed) for seed in range(3)]
    torch.set_num_threads(2)
    try:
        here = run_jobs("sums", jobs, 1)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(1)
    assert here == run_jobs("sums", jobs, 2)
    assert {most for most, *_ in here} == {1}


@pytest.mark.parametrize("workers", [1, 2])
def test_the_cpu_time_of_jobs_counts_wherever_they_run(workers, told):
    before = cpu_seconds()
    run_jobs("burning", [partial(burn, 0.3), partial(burn, 0.4)], workers)
    assert cpu_seconds() - before >= 0.7


def test_workers_have_one_thread_and_the_folder_of_the_command(two_workers, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for variables, folder, pid in run_jobs("settings", [settings, settings], 2):
        assert (variables, folder) == (ONE_THREAD, tmp_path)
        assert pid != os.getpid()


def test_semaphores_of_the_killed_are_removed_and_no_others(tmp_path):
    dead = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True
    )
    ours, theirs = tmp_path / f"sem.loky-{os.getpid()}-abc", tmp_path / f"sem.loky-{dead.stdout.strip()}-abc"
    other = tmp_path / f"sem.mp-{dead.stdout.strip()}"
    for path in (ours, theirs, other):
        path.touch()
    _sweep(tmp_path)
    assert ours.exists() and other.exists() and not theirs.exists()


def test_errors_of_a_job_come_out_of_every_engine(two_workers):
    with pytest.raises(InfeasibleError, match="never valid"):
        run_jobs("failing", [partial(square, 1), partial(fail, InfeasibleError("never valid"))], 2)
    assert run_jobs("after", [partial(slow, 0.0), partial(slow, 0.1)], 2) == [0.0, 0.1]


def test_dask_finishes_on_another_worker_what_a_killed_one_began(dask, monkeypatch, tmp_path):
    monkeypatch.setattr(parallel, "_engine", dask)
    jobs = [partial(die_once, tmp_path / "died"), partial(slow, 0.1), partial(slow, 0.2)]
    assert run_jobs("killed", jobs, 2) == [7, 0.1, 0.2]
    assert (tmp_path / "died").exists()


def test_dask_gives_up_a_job_that_kills_every_worker(dask, monkeypatch):
    monkeypatch.setattr(parallel, "_engine", dask)
    assert run_jobs("before", [partial(slow, 0.0)] * 2, 2) == [0.0, 0.0]  # the cluster is there
    monkeypatch.setattr(dask._client.cluster.scheduler, "allowed_failures", 1)  # each costs a worker's start
    with pytest.raises(SideganError, match="deadly: a worker process was killed"):
        run_jobs("deadly", [die, partial(slow, 0.0)], 2)


def test_a_cluster_elsewhere_is_named_by_its_scheduler(tmp_path):
    distributed = pytest.importorskip("distributed")
    options = {"processes": False, "dashboard_address": ":0", "silence_logs": logging.CRITICAL}
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, **options) as cluster:
        address = cluster.scheduler_address
        with engine("dask", address):
            ((_, pid),) = run_jobs("one", [partial(square, 2)], 1)
    assert pid == os.getpid()  # the cluster's only worker is a thread here: it was not run without it
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, **options) as cluster,
        engine("dask", cluster.scheduler_address),
        pytest.raises(ConfigError, match="--nthreads 1"),
    ):
        run_jobs("one", [partial(square, 2)], 1)


@pytest.mark.slow
def test_a_cluster_that_goes_away_is_told(tmp_path):
    pytest.importorskip("distributed")
    scheduler_file = tmp_path / "scheduler.json"
    dask, quiet = [sys.executable, "-m", "dask"], {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    where = ["--scheduler-file", str(scheduler_file), "--no-dashboard"]
    scheduler = subprocess.Popen([*dask, "scheduler", "--port", "0", *where], **quiet)
    worker = subprocess.Popen([*dask, "worker", "--nthreads", "1", "--no-nanny", *where], **quiet)
    try:
        wait_until(lambda: scheduler_file.exists() and scheduler_file.read_text())
        address = json.loads(scheduler_file.read_text())["address"]
        with engine("dask", address):
            assert run_jobs("short", [partial(slow, 0.0)], None) == [0.0]
            begun = tmp_path / "begun"
            threading.Thread(target=lambda: (wait_until(begun.exists), scheduler.kill())).start()
            with pytest.raises(SideganError, match="long: the Dask cluster went away"):
                run_jobs("long", [partial(begin, begun)], None)
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.wait()


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("sidegan.base.engines._CONNECT", 0.5)
    with engine("dask", "tcp://127.0.0.1:9"), pytest.raises(SideganError, match="no Dask scheduler answers"):
        run_jobs("one", [partial(square, 2)], 2)


def test_a_worker_that_does_not_see_the_folder_says_so():
    with pytest.raises(StorageError, match=r"does not see /no/such/folder .* shared file system"):
        parallel._work(partial(square, 1), 0, lambda message: None, "/no/such/folder")


def test_the_engine_is_one_for_the_block():
    before = parallel._engine
    with engine("dask", "tcp://127.0.0.1:9"):
        assert isinstance(parallel._engine, Dask)
    assert parallel._engine is before


@pytest.mark.parametrize("name", ["loky", "dask"])
def test_workers_end_with_a_process_that_was_killed(tmp_path, name):
    if name == "dask":
        pytest.importorskip("distributed")
    code = (
        "import os, time\nfrom functools import partial\nfrom sidegan.base.parallel import engine, run_jobs\n"
        "def note(folder, report):\n"
        "    open(f'{folder}/{os.getpid()}', 'w').close()\n    time.sleep(60)\n"
        f"with engine({name!r}):\n"
        f"    run_jobs('notes', [partial(note, {str(tmp_path)!r})] * 2, 2)\n"
    )
    main = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    try:
        wait_until(lambda: len(list(tmp_path.iterdir())) == 2)
        processes = members(main.pid)
        assert len(processes) > 2
    finally:
        main.kill()
        main.wait()
    wait_until(lambda: not members(main.pid))


def members(session):
    """Processes of a session that still run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, *rest = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(rest[2]) == session and state != "Z":
            found.append(int(stat.parent.name))
    return found


def wait_until(condition, seconds=120):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.1)


@pytest.mark.parametrize(
    ("error", "workers"),
    [
        (InfeasibleError("never valid"), 2),
        (InfeasibleError("never valid"), 1),
        (ZeroDivisionError("a bug"), 1),
    ],
)
def test_errors_come_out_as_they_are(error, workers):
    with pytest.raises(type(error), match=str(error)):
        run_jobs("failing", [partial(square, 1), partial(fail, error)], workers)


def test_a_killed_worker_is_told_and_the_next_jobs_run():
    with pytest.raises(SideganError, match=r"a worker process was killed.*the same command again goes on"):
        run_jobs("killed", [die, partial(slow, 0.2)], 2)
    assert run_jobs("after", [partial(slow, 0.3), partial(slow, 0.0)], 2) == [0.3, 0.0]


def test_nothing_to_do_and_nothing_to_count():
    assert run_jobs("none", [], 2) == []
    assert run_jobs("one", [lambda report: report(0, 0)], 2) == [None]


def test_workers_are_as_many_as_wanted_or_as_there_are_cores():
    assert cores(3) == 3
    assert cores(None) == len(os.sched_getaffinity(0))
