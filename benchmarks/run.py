"""The command ``python -m benchmarks.run [--json FILE] [--quick]``: how fast the parts are, in one table."""

import argparse
import dataclasses
import json
import os
import platform
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import torch

from benchmarks import data, design, networks, physics
from benchmarks.limits import bandwidth, peak
from benchmarks.seeds import seeds
from benchmarks.setting import Setting
from benchmarks.timing import Row

BENCHMARKS: dict[str, Callable[[Setting], Row]] = {
    "regressor": physics.regressor,
    "gradient": physics.gradient,
    "validity": physics.validity,
    "generation": networks.generation,
    "generate_validate": networks.generate_validate,
    "seeds": seeds,
    "training": networks.training,
    "rls": data.rls,
    "greedy": data.selection,
    "design": design.design,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.run", description="Measure how fast sidegan is."
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write machine and rows there too")
    parser.add_argument("--quick", action="store_true", help="a tenth of the work: does everything run?")
    parser.add_argument("--repeats", type=int, default=5, help="timed runs of each benchmark (default 5)")
    parser.add_argument("--seeds", type=int, help="seeds to optimise (default 50; 5 when quick)")
    parser.add_argument("--only", nargs="+", choices=BENCHMARKS, metavar="NAME", help=", ".join(BENCHMARKS))
    chosen = parser.parse_args(arguments)
    if chosen.repeats < 1:
        parser.error(f"--repeats is {chosen.repeats}, expected at least 1")
    count = chosen.seeds if chosen.seeds is not None else 5 if chosen.quick else 50
    if count < 1:
        parser.error(f"--seeds is {count}, expected at least 1")
    torch.set_num_threads(1)
    setting = Setting(chosen.quick, chosen.repeats, count)
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
        "peak_gflops_float64": {str(n): peak(n) / 1e9 for n in (1, 2)},
        "copy_gigabytes_per_second": bandwidth(2) / 1e9,
        "torch": torch.__version__,
        "numba": _version("numba"),
        "python": platform.python_version(),
    }


def show(rows: Sequence[Row], quick: bool) -> None:
    """Print the rows as one table."""
    from rich.console import Console
    from rich.table import Table

    about = machine()
    peaks = about["peak_gflops_float64"]["2"]
    title = f"{about['cpu']}, two threads {peaks:.0f} Gflop/s, torch {about['torch']}, numba {about['numba']}"
    table = Table(title=title + (" (quick: not worth quoting)" if quick else ""), title_justify="left")
    columns = (
        "name",
        "ours",
        "by CPU",
        "unit",
        "opponent",
        "ratio",
        "limit",
        "of it",
        "goal",
        "reached",
        "threads",
    )
    for column in (*columns, "opponent is"):
        table.add_column(column, justify="left" if column in ("name", "unit", "opponent is") else "right")
    for row in rows:
        ratio = "" if row.ratio is None else f"{row.ratio:.3g}×"
        share = "" if row.share is None else f"{row.share:.1%}"
        numbers = (
            _number(row.ours),
            _number(row.by_cpu),
            row.unit,
            _number(row.opponent),
            ratio,
            _number(row.limit),
            share,
        )
        verdict = (_number(row.goal), "yes" if row.reached else "no", str(row.threads))
        table.add_row(row.name, *numbers, *verdict, row.against)
        for who, value in row.also.items():
            table.add_row("", "", "", "", value if isinstance(value, str) else _number(value), *[""] * 6, who)
    console = Console()
    (console if console.is_terminal else Console(width=200)).print(table)


def _number(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


if __name__ == "__main__":
    sys.exit(main())
