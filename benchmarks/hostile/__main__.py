"""The command ``python -m benchmarks.hostile [--json FILE] [--small]``: what holds, in one table."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import torch

from benchmarks.hostile.rows import ROWS, row
from benchmarks.run import machine
from sidegan.report import export


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 1 when a row does not reach its goal."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hostile", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write machine and rows there too")
    parser.add_argument("--small", action="store_true", help="a sample of the work: does everything run?")
    parser.add_argument("--only", nargs="+", choices=ROWS, metavar="NAME", help=", ".join(ROWS))
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    rows = []
    for name in options.only or ROWS:
        sys.stderr.write(f"{name} …\n")
        rows.append(row(name, ROWS[name](options.small)))
    show(rows)
    if options.json is not None:
        result = {"machine": machine(), "small": options.small, "rows": rows}
        options.json.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0 if all(one["reached"] for one in rows) else 1


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Print the rows as one table, with what stands beside each."""
    cells = []
    for one in rows:
        reached = "yes" if one["reached"] else "no"
        cells.append({"name": one["name"], "ours": _number(one["ours"]), "goal": _number(one["goal"])})
        cells[-1] |= {"reached": reached, "what": one["unit"]}
        cells += [{"ours": _number(value), "what": what} for what, value in one["also"].items()]
    export.show(pd.DataFrame(cells).fillna("").set_index("name"), "Hostile test")


def _number(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


if __name__ == "__main__":
    sys.exit(main())
