"""Times of one unit of work, a group for each work in pytest-benchmark's table, opponents side by side."""

from collections.abc import Callable
from typing import Any

import pytest
import torch
from pytest_benchmark.fixture import BenchmarkFixture

OURS = "sidegan"
Rate = Callable[..., Any]


def pytest_configure(config: pytest.Config) -> None:
    """Show medians and rates of each work."""
    torch.set_num_threads(1)
    config.option.dist = "no"  # benchmarks beside each other would tell nothing
    config.option.benchmark_sort = "fullname"
    config.option.benchmark_columns = ["median", "iqr", "ops", "rounds"]


@pytest.fixture
def rate(benchmark: BenchmarkFixture, request: pytest.FixtureRequest) -> Rate:
    """Time some work that makes so many of a unit; all times are then those of one unit [CPU s]."""

    def measure(work: Callable[..., Any], amount: float, unit: str, rounds: int = 5, **more: Any) -> Any:
        name = request.node.originalname.removeprefix("test_").replace("_", " ")
        benchmark.group = f"{name}, by {unit}"
        result = benchmark.pedantic(work, rounds=rounds, warmup_rounds=1, **more)
        if benchmark.stats is not None:  # --benchmark-disable runs everything once
            times = benchmark.stats.stats.data
            times[:] = [seconds / amount for seconds in times]
        return result

    return measure
