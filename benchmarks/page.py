"""docs/benchmarks.md and its numbers, measured here: rates that are there already stay.

python -m benchmarks.page                 # all rates, and the page
python -m benchmarks.page -k torque       # these rates anew, and the page
"""

import json
import os
import sys
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pytest

from sidegan.pipeline.stages.timing import processor

_NUMBERS = Path(__file__).parents[1] / "docs" / "benchmarks.json"
_PACKAGES = ["sidegan", "numpy", "torch", "numba", "pin", "mujoco", "figaroh"]
_PAGE = """\
# How fast it is

`python -m benchmarks.page` writes this page. The rows come from `pytest benchmarks --benchmark-only`; where
another library computes the same quantity, its row asserts that the numbers agree. FIGAROH is no dependency:
`pip install figaroh`.

{processor}. {versions}.

The arm is the LWR on its desk, with trajectories of 16 s and six harmonics. The rate of a core is per CPU
second on one thread; the rate of two cores is per second of wall time, for libraries that can use them, and
other load on the machine lowers it. The ratio is that of the medians, with that of the extremes in brackets.

| work | by | a core, per CPU second | two cores, per second | ours is faster by |
| --- | --- | --- | --- | --- |
{rows}
"""


def _measured(words: list[str]) -> dict[str, Any]:
    """Seconds per unit, by work and by whom."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rates.json"
        pytest.main(["benchmarks", "-n", "0", "--benchmark-only", f"--benchmark-json={file}", *words])
        rows = json.loads(file.read_text())["benchmarks"]
    found: dict[str, Any] = {}
    for row in rows:
        by, stats = (row["params"] or {}).get("by", "sidegan"), row["stats"]
        rate = {"median": stats["median"], "low": stats["min"], "high": stats["max"]}
        found.setdefault(row["group"], {})[by] = rate | {"wall": row["extra_info"].get("wall") or []}
    return found


def _number(x: float) -> str:
    return f"{x:,.0f}" if x >= 1000 else f"{x:.3g}"


def _rows(rates: dict[str, Any]) -> str:
    """Rows of the table."""
    rows = []
    for group, parts in rates.items():
        ours = parts.get("sidegan")
        for by, rate in parts.items():
            wall = _number(1 / min(rate["wall"])) if rate["wall"] else ""
            ratio = ""
            if ours and rate is not ours:
                ends = ("median", "median"), ("low", "high"), ("high", "low")
                ratio = "{} ({} … {})".format(*(_number(rate[a] / ours[b]) for a, b in ends))
            rows.append(f"| {group} | {by} | {_number(1 / rate['median'])} | {wall} | {ratio} |")
    return "\n".join(rows)


def _version(name: str) -> str:
    try:
        return f"{name} {version(name)}"
    except PackageNotFoundError:
        return f"{name} absent"


def main(words: list[str]) -> None:
    """Measure and write."""
    numbers = json.loads(_NUMBERS.read_text()) if _NUMBERS.exists() else {"rates": {}}
    for group, parts in _measured(words).items():
        numbers["rates"].setdefault(group, {}).update(parts)
    numbers["processor"] = f"{processor()}, {os.cpu_count()} cores, load {os.getloadavg()[1]:.1f}"
    numbers["versions"] = ", ".join(map(_version, _PACKAGES))
    _NUMBERS.write_text(json.dumps(numbers, indent=1) + "\n")
    rows = _rows(numbers["rates"])
    page = _PAGE.format(rows=rows, versions=numbers["versions"], processor=numbers["processor"])
    _NUMBERS.with_suffix(".md").write_text(page)


if __name__ == "__main__":
    main(sys.argv[1:])
