"""docs/benchmarks.md, its figure and its numbers, measured here: what is there already stays.

python -m benchmarks.page                 # rates if there are none, growth that is missing, and the page
python -m benchmarks.page -k torque       # these rates anew
python -m benchmarks.page device.json     # a GPU's, as benchmarks.device printed them elsewhere
python -m benchmarks.page only            # the page alone
"""

import json
import os
import subprocess
import sys
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from benchmarks.growth import POINTS, workers
from sidegan.pipeline.stages.discussion import processor
from sidegan.report.canvas import blank, legend, letter, logarithmic, save, tidy
from sidegan.report.export import markdown
from sidegan.report.style import PALETTE

_DOCS = Path(__file__).parents[1] / "docs"
_NUMBERS, _PAGE, _FIGURE = _DOCS / "benchmarks.json", _DOCS / "benchmarks.md", _DOCS / "images" / "growth.png"
_PACKAGES = ["sidegan", "numpy", "torch", "numba", "pin", "mujoco", "figaroh", "frax", "jax"]
_LARGE = ("library", "greedy", "d_optimal", "rls", "workers")  # a process for each size
_UNITS = {"2,000 seeds": "s", "file": "MB", "peak": "MB", "regressor": "µs", "validity": "µs"}
_SIZES = {
    "library": "trajectories",
    "greedy": "trajectories in the pool",
    "d_optimal": "trajectories in the pool",
}
_SIZES |= {"rls": "recording [s]", "samples": "samples per trajectory"}


def _rates(*words: str) -> dict[str, Any]:
    """Rows of the table, by work and by whom."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rates.json"
        pytest.main(["benchmarks", "-n", "0", "--benchmark-only", f"--benchmark-json={file}", *words])
        rows = json.loads(file.read_text())["benchmarks"]
    found: dict[str, Any] = {}
    for row in rows:
        by = (row["params"] or {}).get("by", "sidegan")
        stats = row["stats"]
        keys = {"median": "median", "low": "min", "high": "max"}
        rate = {key: stats[name] for key, name in keys.items()}
        rate["wall"] = row["extra_info"].get("wall") or []
        found.setdefault(row["group"], {})[by] = rate
    return found


def _grown(name: str, sizes: list[str]) -> dict[str, Any]:
    command = [sys.executable, "-m", "benchmarks.growth", name, *sizes]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def _grow(known: dict[str, Any]) -> None:
    """Measure the sizes that are missing."""
    for work, sizes in POINTS.items():
        name = work.__name__
        missing = [str(size) for size in sizes if str(size) not in known.setdefault(name, {})]
        parts = [[size] for size in missing] if name in _LARGE else [missing]
        for part in filter(None, parts):
            known[name] |= _grown(name, part)


def _number(x: float) -> str:
    return f"{x:,.0f}" if x >= 1000 else f"{x:.3g}"


def _table_of_rates(rates: dict[str, Any]) -> str:
    head = ["work", "by", "a core, per CPU second", "two cores, per second", "ours is faster by"]
    rows = []
    for group, parts in rates.items():
        ours = parts.get("sidegan")
        for by, rate in parts.items():
            wall = _number(1 / min(rate["wall"])) if rate["wall"] else ""
            ratio = ""
            if ours and rate is not ours:
                ends = ("median", "median"), ("low", "high"), ("high", "low")
                ratio = "{} ({} … {})".format(*(_number(rate[a] / ours[b]) for a, b in ends))
            rows.append([group, by, _number(1 / rate["median"]), wall, ratio])
    return markdown(pd.DataFrame(rows, columns=head))


def _table_of_growth(name: str, sizes: dict[str, Any]) -> str:
    keys = list(next(iter(sizes.values())))
    head = [name.replace("_", "-"), *(f"{key} [{_UNITS.get(key, 'CPU s')}]" for key in keys)]
    ordered = sorted(sizes.items(), key=lambda item: int(item[0]))
    rows = [[f"{int(size):,}", *(_number(x) for x in costs.values())] for size, costs in ordered]
    return markdown(pd.DataFrame(rows, columns=head))


def _draw(growth: dict[str, Any]) -> None:
    drawn = [work for work in POINTS if work is not workers]
    figure = blank(11, 5.6)
    axes = figure.subplots(2, -(-len(drawn) // 2)).ravel()
    handles: dict[str, Any] = {}
    shades: dict[str, str] = {}
    for axis, work in zip(axes, drawn):
        name = work.__name__
        sizes = sorted((int(size), costs) for size, costs in growth.get(name, {}).items())
        for key in sizes[0][1] if sizes else []:
            if _UNITS.get(key) != "MB":
                style = {"color": shades.setdefault(key, PALETTE[len(shades)]), "markersize": 4}
                places = [x for x, _ in sizes]
                (handles[key],) = axis.plot(places, [costs[key] for _, costs in sizes], "o-", **style)
        if sizes:
            ends = [sizes[0][0], sizes[-1][0]]
            top = max(x for key, x in sizes[-1][1].items() if _UNITS.get(key) != "MB")
            (handles["slope one"],) = axis.plot(ends, [top * x / ends[1] for x in ends], ":", color="grey")
        axis.set_title(name.replace("_", "-"), fontsize=10)
        axis.set_xlabel(_SIZES.get(name, name), fontsize=9)
        axis.set_ylabel("CPU time [s]" if name in _LARGE else "CPU time per trajectory [µs]", fontsize=9)
        logarithmic(axis, "x")
        logarithmic(axis)
        tidy(axis)
    for axis in axes[len(drawn) :]:
        axis.remove()
    letter(axes[: len(drawn)])
    legend(figure, handles)
    save(figure, _FIGURE.with_suffix(""))


def _versions() -> str:
    found = []
    for name in _PACKAGES:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} absent")
    return ", ".join(found)


def _machine() -> str:
    return f"{processor()}, {os.cpu_count()} cores, load {os.getloadavg()[1]:.1f}"


def _write(numbers: dict[str, Any]) -> None:
    _NUMBERS.write_text(json.dumps(numbers, indent=1) + "\n")
    devices = numbers.get("device", {})
    head = ["networks", "device", "epoch [s]", "sample [µs]"]
    rows = [[key, x["name"], _number(x["epoch"]), _number(x["sample"])] for key, x in devices.items()]
    if "cuda" not in devices:
        rows.append(["cuda", "none on this machine", "", ""])
    growth = {name: sizes for name, sizes in numbers["growth"].items() if sizes}
    _draw(growth)
    text = (Path(__file__).parent / "page.md").read_text()
    fields = {"versions": numbers["versions"], "processor": numbers["processor"]}
    fields |= {
        "rates": _table_of_rates(numbers["rates"]),
        "device": markdown(pd.DataFrame(rows, columns=head)),
    }
    tables = "\n\n".join(_table_of_growth(*item) for item in growth.items())
    _PAGE.write_text(text.format(growth=tables, **fields))


def main(words: list[str]) -> None:
    """Measure and write."""
    numbers = json.loads(_NUMBERS.read_text()) if _NUMBERS.exists() else {"rates": {}, "growth": {}}
    if words == ["only"]:
        pass
    elif words and words[0].endswith(".json"):
        numbers["device"] = json.loads(Path(words[0]).read_text())
    else:
        if words or not numbers["rates"]:
            numbers |= {"versions": _versions(), "processor": _machine()}  # of the rates
            for group, parts in _rates(*words).items():
                numbers["rates"].setdefault(group, {}).update(parts)
        if not words:
            _grow(numbers["growth"])
    _write(numbers)


if __name__ == "__main__":
    main(sys.argv[1:])
