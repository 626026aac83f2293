"""The table of benchmarks, each row in its own unit."""

import time
from collections.abc import Callable
from typing import Any

import pytest
import torch
from pytest_benchmark.fixture import BenchmarkFixture

OURS = "sidegan"
_HEADER = ("work", "by", "a second", "unit", "each", "sidegan is")
_PREFIXES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
Rate = Callable[..., Any]

rows: list[tuple[str, str, float, str]] = []  # work, by whom, units a second, unit


def pytest_configure(config: pytest.Config) -> None:
    """Show medians and rates where trees are compared; else our own table stands in place of theirs."""
    torch.set_num_threads(1)
    config.option.dist = "no"  # benchmarks beside each other would tell nothing
    config.option.benchmark_sort = "fullname"
    config.option.benchmark_columns = ["median", "iqr", "ops", "rounds"]
    config.option.benchmark_quiet = not config.option.benchmark_compare


@pytest.fixture
def rate(benchmark: BenchmarkFixture, request: pytest.FixtureRequest) -> Rate:
    """Time some work that makes so many of a unit; all times are then those of one unit [CPU s]."""

    def measure(work: Callable[..., Any], amount: float, unit: str, rounds: int = 5, **more: Any) -> Any:
        benchmark.extra_info["unit"] = unit
        benchmark._timer = time.process_time
        result = benchmark.pedantic(work, rounds=rounds, warmup_rounds=1, **more)
        if benchmark.stats is not None:  # --benchmark-disable runs everything once
            times = benchmark.stats.stats.data
            times[:] = [seconds / amount for seconds in times]
            name = request.node.originalname.removeprefix("test_").replace("_", " ")
            by = request.node.callspec.params["by"] if hasattr(request.node, "callspec") else OURS
            rows.append((name, by, 1 / benchmark.stats.stats.median, unit))
        return result

    return measure


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print the table."""
    if not rows or config.option.benchmark_compare:
        return
    ours = {work: a_second for work, by, a_second, _ in rows if by == OURS}
    table = [_HEADER]
    for work, by, a_second, unit in rows:
        times = "" if by == OURS or work not in ours else f"{_number(ours[work] / a_second)} times as fast"
        table.append((work, by, _number(a_second), unit, _seconds(1 / a_second), times))
    widths = [max(map(len, column)) for column in zip(*table)]
    terminalreporter.section("CPU time on one thread")
    for row in table:
        cells = (
            f"{cell:>{width}}" if k in (2, 4) else f"{cell:<{width}}"
            for k, (cell, width) in enumerate(zip(row, widths))
        )
        terminalreporter.write_line("  ".join(cells).rstrip())


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def _seconds(value: float) -> str:
    size, prefix = next((one for one in _PREFIXES if value >= one[0]), _PREFIXES[-1])
    return f"{value / size:.3g} {prefix}"
