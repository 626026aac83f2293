"""The command ``python -m benchmarks.mutants``: which small errors in the code do the tests not notice?

Physics, statistics and stages are changed in one place at a time by cosmic-ray's operators (+ for −, < for ≤,
a number one larger …), drawn at random from all such places. The tests nearest to the change run, then all of
its room's and of those that use it; what survives is listed with its change. Work goes on where it was
stopped. The tree itself is left alone: everything happens in a copy. Tests run in copies of a warm process,
and of the kernels only those that a change is part of are compiled anew.
"""

import argparse
import ast
import difflib
import json
import os
import random
import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from benchmarks.tree import ROOT, copied
from benchmarks.warm import Bounds, Warm
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
# [s] for the tests of one mutant, after which it counts as noticed, since it has no end: of the processor,
# and on the clock, which runs on while others use the machine
_PATIENCE, _LONGEST = 600, 3600
_ROOM = 12 * 2**30  # [bytes] for a process of its tests: what grows without an end is noticed, too
_STAGES = Path("tests/experiments")  # run what no other test runs
_EVERYWHERE = ("pipeline", "report")  # rooms that use all others
_COMPILED = "sidegan/motion/compiled/"
_KEPT = "kernels"  # folder of compiled kernels beside the copy of the project
_WHOLE = ".whole"  # ends the name of a file that is changed at the moment
_FAILED = re.compile(r"^FAILED (.+?)(?: - .*)?$", re.MULTILINE)  # a line of pytest's summary


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


def draw(root: Path, count: int, seed: int) -> list[Mutant]:
    """So many random mutants of the code below a root; those that are no Python are none."""
    every = list(mutants(root))
    random.Random(seed).shuffle(every)
    return list(islice((one for one in every if _parses(one, root)), count))


def _parses(one: Mutant, root: Path) -> bool:
    try:  # ** of a dictionary is changed like that of a power
        ast.parse(mutated(one, (root / one.file).read_text(encoding="utf-8")))
    except SyntaxError:
        return False
    return True


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
    """Tests of a file, nearest first: that are named like it or import it, that name it, others.

    Its rooms are its own and those that use it, where they are not the pipeline, which uses everything.
    """
    _, *room, name = Path(file).with_suffix("").parts
    whole = [_folder(room, root), *([_STAGES] if room[:2] == ["pipeline", "stages"] else [])]
    whole += [one for one in _used_in(file, root) if one not in whole]
    every = sorted((root / "tests").rglob("test_*.py"))
    named = [path for path in every if path.stem == f"test_{name}" or file in imported(path, root)]
    others = [path for one in whole for path in sorted((root / one).rglob("test_*.py")) if path not in named]
    times = {path: len(re.findall(rf"\b{name}\b", path.read_text(encoding="utf-8"))) for path in others}
    telling = sorted((path for path in others if times[path]), key=lambda path: -times[path])
    steps = [named, *([path] for path in telling), [path for path in others if not times[path]]]
    return [[str(path.relative_to(root)) for path in step] for step in steps if step]


def _folder(room: Sequence[str], root: Path) -> Path:
    """Folder of the tests that are nearest to a room."""
    folders = [Path("tests", *room[:k]) for k in range(len(room), 0, -1)]
    return next(one for one in folders if (root / one).is_dir())


def _used_in(file: str, root: Path) -> list[Path]:
    """Folders of the tests of other rooms that use a file, directly or through others of its own room."""
    room, found, seen, asked = Path(file).parent, list[Path](), {file}, [file]
    sources = {str(one.relative_to(root)): imported(one, root) for one in (root / "sidegan").rglob("*.py")}
    while asked:
        used = asked.pop()
        for user in sorted(one for one, names in sources.items() if used in names and one not in seen):
            seen.add(user)
            parts = Path(user).parent.parts[1:]
            if Path(user).parent == room:
                asked.append(user)
            elif parts and parts[0] not in _EVERYWHERE and (folder := _folder(parts, root)) not in found:
                found.append(folder)
    return found


@cache
def imported(source: Path, root: Path) -> set[str]:
    """Files of the project that a source imports, from its root; no mutant changes those."""
    found = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            whole = node.module.split(".")
            found |= {"/".join([*whole, one.name]) for one in node.names} | {"/".join(whole)}
    return {f"{one}.py" for one in found if (root / f"{one}.py").is_file()}


def noticed(one: Mutant, root: Path, warm: Warm) -> tuple[bool, float]:
    """Whether a test fails with a mutant in the copy of the project at ``root``; CPU time that it took [s].

    Raises:
        ConfigError: when the test fails without the mutant too.
    """
    path = root / one.file
    source, whole = path.read_text(encoding="utf-8"), path.with_name(f"{path.name}{_WHOLE}")
    path.rename(whole)
    first, seconds = None, 0.0
    try:
        path.write_text(mutated(one, source), encoding="utf-8")
        with _kernels(one, root) as kernels:
            for tests in tests_of(one.file, root):
                first, took = _failing(tests, root, kernels, warm)
                seconds += took
                if first is not None:
                    break
    finally:
        whole.replace(path)
    if first:
        anyway, took = _failing([first], root, root.with_name(_KEPT), warm)
        seconds += took
        if anyway is not None:
            raise ConfigError(f"{first} fails without a mutant")
    return first is not None, seconds


@contextmanager
def _kernels(one: Mutant, root: Path) -> Iterator[Path]:
    """Folder of compiled kernels; a copy that is thrown away where a mutant is part of kernels."""
    kept = root.with_name(_KEPT)
    kept.mkdir(exist_ok=True)
    if not one.file.startswith(_COMPILED):
        yield kept
        return
    changed = root.with_name(f"{_KEPT}_of_mutant")
    shutil.rmtree(changed, ignore_errors=True)
    shutil.copytree(kept, changed, copy_function=os.link)  # numba replaces files and writes into none
    try:
        yield changed
    finally:
        shutil.rmtree(changed, ignore_errors=True)


def _failing(tests: list[str], root: Path, kernels: Path, warm: Warm) -> tuple[str | None, float]:
    """The first test that fails, empty where none can be named, None when all pass; CPU time [s]."""
    arguments = ["-x", "-q", "-p", "no:cacheprovider", *tests]
    done = warm.run(arguments, root, kernels, Bounds(_PATIENCE, _LONGEST, _ROOM))
    if done.code is not None and done.code > 2:  # neither passed, failed nor broken by the change
        raise ConfigError(f"pytest {' '.join(arguments)} ended with {done.code}: {done.output[-1000:]}")
    named = _FAILED.search(done.output) if done.code == 1 else None
    return None if done.code == 0 else named[1] if named else "", done.seconds


def change(one: Mutant, root: Path) -> str:
    """What a mutant changes, as the lines before and after."""
    source = (root / one.file).read_text(encoding="utf-8")
    lines = difflib.unified_diff(source.splitlines(), mutated(one, source).splitlines(), lineterm="", n=0)
    return " → ".join(line[1:].strip() for line in list(lines)[2:] if line[0] in "+-")


def run(count: int, seed: int, work: Path) -> pd.DataFrame:
    """Which of ``count`` random mutants are noticed, a row each; what is in ``work`` is not done again."""
    tree, record = copied(ROOT, work / "tree"), work / f"{count}-{seed}.jsonl"
    for whole in tree.rglob(f"*{_WHOLE}"):  # of a run that was killed
        whole.replace(whole.with_name(whole.name.removesuffix(_WHOLE)))
    drawn = draw(tree, count, seed)
    rows: list[dict[str, Any]] = []
    if record.exists():
        rows = [json.loads(line) for line in record.read_text(encoding="utf-8").splitlines()]
    with bar("mutants", count) as told, record.open("a", encoding="utf-8") as file, Warm() as warm:
        for done, one in enumerate(drawn[len(rows) :], start=len(rows)):
            told(done)
            found, seconds = noticed(one, tree, warm)
            about = {"noticed": found, "cpu_seconds": round(seconds, 1), "change": change(one, tree)}
            rows.append({**one._asdict(), **about})
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
    print(
        f"CPU seconds for each: median {frame.cpu_seconds.median():.3g}, mean {frame.cpu_seconds.mean():.3g}"
    )
    survivors = frame[~frame.noticed].set_index("file")[["change"]]
    if len(survivors):
        export.show(survivors, "What survives")
    return 0


if __name__ == "__main__":
    sys.exit(main())
