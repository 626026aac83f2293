"""The command ``python -m benchmarks.run [--json FILE] [--quick]``: how fast the parts are, in one table."""

import argparse
import dataclasses
import json
import os
import platform
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import torch

from benchmarks import physics, pipeline
from benchmarks.setting import Setting
from benchmarks.timing import Row

BENCHMARKS: dict[str, Callable[[Setting], Row]] = {
    "regressor": physics.regressor,
    "gradient": physics.gradient,
    "validity": physics.validity,
    "generation": pipeline.generation,
    "generate_validate": pipeline.generate_validate,
    "seeds": pipeline.seeds,
    "rls": pipeline.rls,
    "greedy": pipeline.selection,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.run", description="Measure how fast sidegan is."
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write machine and rows there too")
    parser.add_argument("--quick", action="store_true", help="a tenth of the work: does everything run?")
    parser.add_argument("--repeats", type=int, default=5, help="timed runs of each benchmark (default 5)")
    parser.add_argument("--only", nargs="+", choices=BENCHMARKS, metavar="NAME", help=", ".join(BENCHMARKS))
    chosen = parser.parse_args(arguments)
    if chosen.repeats < 1:
        parser.error(f"--repeats is {chosen.repeats}, expected at least 1")
    torch.set_num_threads(1)
    setting = Setting(chosen.quick, chosen.repeats)
    rows = []
    for name in chosen.only or BENCHMARKS:
        sys.stderr.write(f"{name} …\n")
        rows.append(BENCHMARKS[name](setting))
    show(rows, chosen.quick)
    if chosen.json is not None:
        result = {
            "machine": machine(),
            "quick": chosen.quick,
            "rows": [dataclasses.asdict(row) for row in rows],
        }
        chosen.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 0


def machine() -> dict[str, Any]:
    """What the numbers were measured on."""
    return {
        "cpu": _cpu(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "torch": torch.__version__,
        "python": platform.python_version(),
    }


def show(rows: Sequence[Row], quick: bool) -> None:
    """Print the rows as one table."""
    from rich.console import Console
    from rich.table import Table

    about = machine()
    title = f"{about['cpu']}, one thread, torch {about['torch']}, Python {about['python']}"
    table = Table(title=title + (" (quick: not worth quoting)" if quick else ""), title_justify="left")
    for column in ("name", "ours", "unit", "opponent", "ratio", "opponent is"):
        table.add_column(column, justify="left" if column in ("name", "unit", "opponent is") else "right")
    for row in rows:
        numbers = (_number(row.ours), row.unit, _number(row.opponent), f"{row.ratio:.3g}×")
        table.add_row(row.name, *numbers, row.against)
    console = Console()
    (console if console.is_terminal else Console(width=140)).print(table)


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


if __name__ == "__main__":
    sys.exit(main())
