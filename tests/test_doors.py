"""Each heavy package has one room, and rooms import only those before them."""

import ast
from functools import cache
from pathlib import Path

import pytest

import sidegan

SOURCE = Path(sidegan.__file__).parent


DOORS = {
    "pinocchio": {"robot"},
    "coal": {"robot"},
    "hppfcl": {"robot"},
    "pygmo": {"seeds"},
    "pytorch_lightning": {"gan"},
    "mlflow": {"tracking"},
    "joblib": {"engines"},
    "distributed": {"engines"},
    "hydra": {"run", "config", "stages", "callbacks"},
    "omegaconf": {"config", "run", "callbacks"},
    "matplotlib": {"report"},
    "plotly": {"report"},
    "numba": {"kernels"},
    "mujoco": {"plant"},
    "cvxpy": {"identification"},
    "rosbags": {"recording"},
}
ORDER = {
    "robot": 0,
    "trajectory": 1,
    "kernels": 2,
    "dynamics": 3,
    "excitation": 4,
    "criteria": 4,
    "validity": 4,
    "seeds": 5,
    "gan": 6,
    "conditional": 6.5,
    "library": 7,
    "information": 5,
    "selection": 8,
    "optimal": 8,
    "plant": 9,
    "recording": 9,
    "identification": 10,
    "report": 11,
}
SIDE_BY_SIDE = {"seeds", "gan", "library", "selection", "optimal", "plant", "recording", "identification"}
KNOWN = {"gan": {"seeds"}}  # exact physics in the loop is the seeds' problem
ABOVE = {
    "plan",
    "plan_conditional",
    "plan_beyond",
    "stages",
    "run",
    "callbacks",
}  # what puts the rooms together


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


FILES = sorted(SOURCE.rglob("*.py"))
IMPORTS = [(path, name) for path in FILES for name in imported(path)]


def rooms(path):
    """Rooms that a file imports."""
    names = [name.split(".") for name in imported(path)]
    return {parts[1] for parts in names if parts[0] == "sidegan" and len(parts) > 1}


def test_every_room_is_there():
    assert set(ORDER) | ABOVE <= {room_of(path) for path in FILES}, "a room is missing"


@pytest.mark.parametrize(("package", "door"), DOORS.items())
def test_a_heavy_package_has_one_door(package, door):
    users = {room_of(path) for path, name in IMPORTS if name.split(".")[0] == package}
    assert users <= door


@pytest.mark.parametrize("room", ORDER)
def test_a_room_imports_only_those_before_it(room):
    for path in FILES:
        if room_of(path) == room:
            for other in rooms(path) - {room}:
                assert other not in ABOVE | {"config"}, f"{path} imports {other}"
                assert ORDER.get(other, -1) < ORDER[room], f"{path} imports {other}"


@pytest.mark.parametrize("room", sorted(SIDE_BY_SIDE))
def test_rooms_side_by_side_do_not_know_each_other(room):
    for path in FILES:
        if room_of(path) == room:
            assert not rooms(path) & (SIDE_BY_SIDE - {room} - KNOWN.get(room, set())), path


def test_what_serves_every_room_knows_none():
    for path in FILES:
        if room_of(path) in {
            "errors",
            "storage",
            "progress",
            "typed",
            "stamp",
            "artifacts",
            "tracking",
            "engines",
        }:
            assert not rooms(path) & set(ORDER), path


def test_experiments_use_only_what_is_below_them():
    folder = SOURCE.parent / "experiments"
    for path in folder.glob("*.py"):
        assert not rooms(path) & {"run", "stages", "callbacks", "gan", "seeds"}, path
