import os
import time
from functools import partial

import pytest

from sidegan import parallel
from sidegan.errors import InfeasibleError, SideganError
from sidegan.parallel import cores, run_jobs


def square(x, report):
    for step in range(10):
        report(step + 1, 10)
    return x * x, os.getpid()


def fail(error, report):
    raise error


def die(report):
    os.kill(os.getpid(), 9)


def slow(seconds, report):
    time.sleep(seconds)
    return seconds


@pytest.fixture
def told(monkeypatch):
    """Every (done, total) that the bar was told."""
    calls = []

    class Bar:
        def __init__(self, *args):
            pass

        def __enter__(self):
            return lambda done, total: calls.append((done, total))

        def __exit__(self, *args):
            pass

    monkeypatch.setattr(parallel, "bar", Bar)
    return calls


@pytest.mark.parametrize("workers", [1, 2])
def test_results_are_in_order_and_progress_reaches_the_end(workers, told):
    results = run_jobs("squares", [partial(square, x) for x in (5, 3, 4)], workers)
    assert [value for value, _ in results] == [25, 9, 16]
    assert ({pid for _, pid in results} == {os.getpid()}) == (workers == 1)
    assert told == sorted(told) and told[-1] == (100, 100)


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
    with pytest.raises(SideganError, match="the same command again goes on where it was"):
        run_jobs("killed", [die, partial(slow, 0.2)], 2)
    assert run_jobs("after", [partial(slow, 0.3), partial(slow, 0.0)], 2) == [0.3, 0.0]


def test_nothing_to_do_and_nothing_to_count():
    assert run_jobs("none", [], 2) == []
    assert run_jobs("one", [lambda report: report(0, 0)], 2) == [None]


def test_workers_are_as_many_as_wanted_or_as_there_are_cores():
    assert cores(3) == 3
    assert cores(None) == len(os.sched_getaffinity(0))
