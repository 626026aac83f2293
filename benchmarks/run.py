"""The command ``python -m benchmarks.run [--json FILE] [--quick]``: how fast the parts are, in one table."""

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd
import torch

from benchmarks import data, designer, networks, physics, seeds
from benchmarks.setting import Setting
from benchmarks.timing import ROWS, Result, row
from sidegan.report import export

_NUMBERS = ("ours", "by_cpu", "opponent", "ratio", "goal", "threads")

BENCHMARKS: dict[str, Callable[[Setting], Result]] = {
    "regressor": physics.regressor,
    "gradient": physics.gradient,
    "validity": physics.validity,
    "generation": networks.generation,
    "generate_validate": networks.generate_validate,
    "seeds": seeds.seeds,
    "training": networks.training,
    "rls": data.rls,
    "greedy": data.selection,
    "design": data.design,
    "evaluation": seeds.evaluation,
    "paper_seeds": seeds.paper_seeds,
    "design_evaluation": designer.design_evaluation,
    "design_setup": designer.design_setup,
    "design_8ms": designer.design_8ms,
    "design_12ms": designer.design_12ms,
    "design_50ms_worst": designer.design_50ms_worst,
    "design_next": designer.design_next,
    "set_of_35": seeds.set_of_35,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.run", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write machine and rows there too")
    parser.add_argument("--quick", action="store_true", help="a tenth of the work: does everything run?")
    parser.add_argument("--repeats", type=int, default=5, help="timed runs of each benchmark (default 5)")
    parser.add_argument("--only", nargs="+", choices=BENCHMARKS, metavar="NAME", help=", ".join(BENCHMARKS))
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        parser.error(f"--repeats is {options.repeats}, expected at least 1")
    setting = Setting(options.quick, options.repeats)
    rows = []
    for name in options.only or BENCHMARKS:
        sys.stderr.write(f"{name} …\n")
        torch.set_num_threads(ROWS[name]["threads"])
        rows.append(row(name, BENCHMARKS[name](setting)))
    show(rows, options.quick)
    if options.json is not None:
        result = {"machine": machine(), "quick": options.quick, "rows": rows}
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 0


def show(rows: Sequence[dict[str, Any]], quick: bool) -> None:
    """Print the rows as one table."""
    about, cells = machine(), []
    for one in rows:
        numbers = {column: _number(one[column]) for column in _NUMBERS}
        words = {"reached": "yes" if one["reached"] else "no", "unit": one["unit"]}
        cells.append({"name": one["name"], **numbers, **words, "opponent is": one["against"]})
        cells += [{"opponent": _number(value), "opponent is": who} for who, value in one["also"].items()]
    title = f"{about['cpu']}, {about['cores']} cores, torch {about['torch']}, numba {about['numba']}"
    table = pd.DataFrame(cells).fillna("").set_index("name")
    export.show(table, title + (" (quick: not worth quoting)" if quick else ""))


def machine() -> dict[str, Any]:
    """What the numbers were measured on."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "cpu": models[0] if models else platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "torch": torch.__version__,
        "numba": version("numba"),
        "python": platform.python_version(),
    }


def _number(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


if __name__ == "__main__":
    sys.exit(main())
