"""Each heavy package has one door, and rooms import only those before them, as docs/architecture.md says."""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import sidegan

SOURCE = Path(sidegan.__file__).parent
DOORS = {
    "pinocchio": {"robot"},
    "coal": {"robot"},
    "hppfcl": {"robot"},
    "pygmo": {"seeding"},
    "torch": {"gan"},
    "pytorch_lightning": {"gan"},
    "joblib": {"base", "robot"},
    "distributed": {"base"},
    "mlflow": {"pipeline"},
    "hydra": {"pipeline", "run"},
    "omegaconf": {"pipeline", "run"},
    "matplotlib": {"report"},
    "trimesh": {"robot", "report"},
    "numba": {"kernels"},
    "mujoco": {"plant", "robot"},
    "xacrodoc": {"robot"},
    "robot_descriptions": {"robot"},
    "cvxpy": {"identification"},
    "rosbags": {"recording"},
}
ORDER = ["errors", "base", "robot", "kernels", "motion", "validity", "design", "cell", "library", "seeding"]
ORDER += ["gan", "plant", "recording", "identification", "controllers", "report", "steps", "pipeline"]
ORDER += ["run"]
STRANGERS = [{"gan"}, {"plant"}, {"recording"}]  # side by side: the pipeline hands arrays across


def room_of(path):
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


@cache
def imported(path):
    """Absolute names of everything that a file imports, wherever in it."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return names


COPIED = "arm_dynamics.py"  # stands on its own beside an identified arm
FILES = sorted(path for path in SOURCE.rglob("*.py") if room_of(path) != "__init__" and path.name != COPIED)
IMPORTS = [(path, name) for path in FILES for name in imported(path)]


def rooms(path):
    """Rooms that a file imports."""
    names = [name.split(".") for name in imported(path)]
    return {parts[1] for parts in names if parts[0] == "sidegan" and len(parts) > 1} & set(ORDER)


def test_every_subpackage_is_in_the_order():
    assert {room_of(path) for path in FILES} == set(ORDER)


@pytest.mark.parametrize(("package", "door"), DOORS.items())
def test_each_heavy_package_is_imported_in_one_place(package, door):
    assert {room_of(path) for path, name in IMPORTS if name.split(".")[0] == package} <= door


def test_kernels_depend_on_arrays_only():
    known = {name.split(".")[0] for path, name in IMPORTS if room_of(path) == "kernels"}
    assert not known & {"scipy", "mujoco"}
    assert all(rooms(path) <= {"kernels", "base"} for path in FILES if room_of(path) == "kernels")


@pytest.mark.parametrize("room", ORDER)
def test_subpackages_import_only_earlier_ones(room):
    for path in FILES:
        if room_of(path) == room:
            for other in rooms(path) - {room}:
                assert ORDER.index(other) < ORDER.index(room), f"{path} imports {other}"


@pytest.mark.parametrize("strangers", STRANGERS)
def test_sibling_subpackages_do_not_import_each_other(strangers):
    others = set().union(*STRANGERS) - strangers
    for path in FILES:
        if room_of(path) in strangers:
            assert not rooms(path) & others, path


def modules(path):
    """Files of sidegan that a file needs to run, wherever in it they are imported; types alone need none."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    typed = [
        block
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.unparse(block.test)
    ]
    skipped = {part for block in typed for part in ast.walk(block)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node not in skipped:
            for alias in node.names:
                parts = f"{node.module}.{alias.name}".split(".")[1:]
                inner, outer = (SOURCE.joinpath(*some).with_suffix(".py") for some in (parts, parts[:-1]))
                found = (inner, outer, outer.with_suffix("") / "__init__.py")
                yield from [path for path in found if path.is_file()][:1]


def test_there_are_no_import_cycles():
    graph = {path: {*modules(path)} - {path} for path in FILES}
    assert len([*TopologicalSorter(graph).static_order()]) >= len(FILES)  # or it raises CycleError


def test_experiments_import_only_the_pipeline_and_below():
    files = list((SOURCE.parent / "experiments").glob("*.py"))
    assert len(files) > 5
    for path in files:
        assert not {name for name in imported(path) if name.startswith("sidegan.pipeline.run")}, path
        assert not {name for name in imported(path) if name.split(".")[0] in ("hydra", "mlflow")}, path


def test_the_documented_order_is_the_tested_one():
    text = (SOURCE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = text.partition("| room | in | out |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| ([^|]+) \|", table, re.M)
    named = [name for row in rows for name in re.findall(r"`(\w+)", row)]
    order = list(dict.fromkeys(name for name in named if name in ORDER))
    assert order == [room for room in ORDER if room != "run"]
