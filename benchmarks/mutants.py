"""The command ``python -m benchmarks.mutants``: which small errors in the code do the tests not notice?

Physics, statistics and stages are changed in one place at a time by cosmic-ray's operators (+ for −, < for ≤,
a number one larger …), drawn at random from all such places. The tests nearest to the change run, then all of
its room's; what survives is listed with its change. Work goes on where it was stopped. The tree itself is
left alone: everything happens in a copy.
"""

import argparse
import difflib
import json
import random
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from benchmarks.tree import ROOT, copied
from sidegan.base.progress import bar
from sidegan.errors import ConfigError
from sidegan.report import export

PARTS = {
    "physics": ("motion", "validity", "robot", "design"),
    "statistics": ("identification", "library"),
    "stages": ("pipeline/stages",),
}
GOAL = 0.9  # share of the mutants that are noticed
_BINARY = ("Add", "Sub", "Mul", "Div", "Pow")  # operators; | stands in type annotations too
_OTHERS = ("And", "Or", "True", "False", "NumberReplacer", "ZeroIteration", "AddNot", "Comparison", "Unary")
_PATIENCE = 600  # [s] for the tests of one mutant, after which it counts as noticed: it hangs


class Mutant(NamedTuple):
    """One change of one file."""

    part: str
    file: str  # from the root of the project
    operator: str
    occurrence: int


def operators() -> list[str]:
    """Names of cosmic-ray's operators that change what a formula or a condition says.

    Raises:
        ConfigError: without cosmic-ray.
    """
    try:
        from cosmic_ray import plugins
    except ImportError as error:
        raise ConfigError("mutants need cosmic-ray: pip install 'sidegan[mutants]'") from error
    names = [name.split("/")[1] for name in plugins.operator_names()]
    return [name for name in names if _changes(name)]


def _changes(name: str) -> bool:
    kind, *rest = name.removeprefix("Replace").split("_")
    if kind == "BinaryOperator":
        return all(part in _BINARY for part in rest)
    return "Is" not in rest and any(word in name for word in _OTHERS)


def mutants(root: Path) -> Iterator[Mutant]:
    """Every mutant of the code below a root."""
    from cosmic_ray import plugins
    from cosmic_ray.ast import ast_nodes, get_ast

    chosen = {name: plugins.get_operator(f"core/{name}")() for name in operators()}
    for part, rooms in PARTS.items():
        for path in sorted(file for room in rooms for file in (root / "sidegan" / room).rglob("*.py")):
            nodes = list(ast_nodes(get_ast(path.read_text(encoding="utf-8"))))
            for name, operator in chosen.items():
                places = sum(1 for node in nodes for _ in operator.mutation_positions(node))
                for occurrence in range(places):
                    yield Mutant(part, str(path.relative_to(root)), name, occurrence)


def mutated(one: Mutant, source: str) -> str:
    """The changed source."""
    from cosmic_ray import plugins
    from cosmic_ray.mutating import mutate_code

    code = mutate_code(source, plugins.get_operator(f"core/{one.operator}")(), one.occurrence)
    if code is None:
        raise ConfigError(f"{one.file} has changed since its mutants were listed: begin with another --work")
    return str(code)


def tests_of(file: str, root: Path) -> list[list[str]]:
    """Tests of a file, nearest first: those named like it, then all of its room's."""
    _, *room, name = Path(file).with_suffix("").parts
    folders = [Path("tests", *room[:k]) for k in range(len(room), 0, -1)]
    folder = next(one for one in folders if (root / one).is_dir())
    named = sorted(str(path.relative_to(root)) for path in (root / "tests").rglob(f"test_{name}.py"))
    return [named, [str(folder)]] if named else [[str(folder)]]


def noticed(one: Mutant, root: Path) -> bool:
    """Whether a test fails with a mutant in the copy of the project at ``root``."""
    path = root / one.file
    source = path.read_text(encoding="utf-8")
    try:
        path.write_text(mutated(one, source), encoding="utf-8")
        return any(_fails(some, root) for some in tests_of(one.file, root))
    finally:
        path.write_text(source, encoding="utf-8")


def _fails(tests: list[str], root: Path) -> bool:
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        code = subprocess.run(command, cwd=root, capture_output=True, timeout=_PATIENCE).returncode
    except subprocess.TimeoutExpired:
        return True
    if code > 2:  # neither passed, failed nor broken by the change
        raise ConfigError(f"{' '.join(command)} ended with {code}")
    return code != 0


def change(one: Mutant, root: Path) -> str:
    """What a mutant changes, as the lines before and after."""
    source = (root / one.file).read_text(encoding="utf-8")
    lines = difflib.unified_diff(source.splitlines(), mutated(one, source).splitlines(), lineterm="", n=0)
    return " → ".join(line[1:].strip() for line in list(lines)[2:] if line[0] in "+-")


def run(count: int, seed: int, work: Path) -> pd.DataFrame:
    """Which of ``count`` random mutants are noticed, a row each; what is in ``work`` is not done again."""
    tree, record = copied(ROOT, work / "tree"), work / f"{count}-{seed}.jsonl"
    drawn = random.Random(seed).sample(list(mutants(tree)), count)
    rows: list[dict[str, Any]] = []
    if record.exists():
        rows = [json.loads(line) for line in record.read_text(encoding="utf-8").splitlines()]
    with bar("mutants", count) as told, record.open("a", encoding="utf-8") as file:
        for done, one in enumerate(drawn[len(rows) :], start=len(rows)):
            told(done)
            rows.append({**one._asdict(), "noticed": noticed(one, tree), "change": change(one, tree)})
            file.write(f"{json.dumps(rows[-1], ensure_ascii=False)}\n")
            file.flush()
    return pd.DataFrame(rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="mutants to draw (default 200)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (default 0)")
    parser.add_argument("--work", type=Path, default=Path("outputs/mutants"), help="copy and records")
    options = parser.parse_args(arguments)
    frame = run(options.count, options.seed, options.work)
    parts = frame.groupby("part").noticed.agg(["size", "sum", "mean"])
    parts.loc["all"] = [len(frame), frame.noticed.sum(), frame.noticed.mean()]
    parts.columns = pd.Index(["mutants", "noticed", f"share (goal {GOAL:.0%})"])
    export.show(parts.astype({"mutants": int, "noticed": int}).round(3), "Mutants that the tests notice")
    survivors = frame[~frame.noticed].set_index("file")[["change"]]
    if len(survivors):
        export.show(survivors, "What survives")
    return 0


if __name__ == "__main__":
    sys.exit(main())
