"""Times of one unit of work, a group for each work in pytest-benchmark's table, opponents side by side."""

import time
from collections.abc import Callable
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from sidegan.base.threads import on_threads

OURS = "sidegan"
Rate = Callable[..., Any]


def pytest_configure(config: pytest.Config) -> None:
    """Show medians and rates of each work."""
    config.option.dist = "no"  # benchmarks beside each other would tell nothing
    config.option.benchmark_sort = "fullname"
    config.option.benchmark_columns = ["median", "iqr", "ops", "rounds"]


@pytest.fixture
def rate(benchmark: BenchmarkFixture, request: pytest.FixtureRequest) -> Rate:
    """Time some work that makes so many of a unit; all times are then those of one unit [CPU s].

    ``both``: the work on two cores, whose wall time of one unit [s] is told as well.
    """

    def measure(
        work: Callable[..., Any],
        amount: float,
        unit: str,
        rounds: int = 5,
        both: Callable[[], Any] | None = None,
        **more: Any,
    ) -> Any:
        name = request.node.originalname.removeprefix("test_").replace("_", " ")
        benchmark.group = f"{name}, by {unit}"
        result = benchmark.pedantic(work, rounds=rounds, warmup_rounds=int(rounds > 1), **more)
        if benchmark.stats is not None:  # --benchmark-disable runs everything once
            times = benchmark.stats.stats.data
            times[:] = [seconds / amount for seconds in times]
            benchmark.extra_info["wall"] = [_wall(both) / amount for _ in range(3)] if both else []
        return result

    return measure


def _wall(work: Callable[[], Any]) -> float:
    """Wall time [s] of some work on two threads."""
    with on_threads(2):
        start = time.perf_counter()
        work()
        return time.perf_counter() - start
