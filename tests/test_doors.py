"""docs/architecture.md has the order of rooms and the doors of packages that ``lint-imports`` enforces."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def contracts():
    """Contracts of import-linter, by name."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return {contract["name"]: contract for contract in project["tool"]["importlinter"]["contracts"]}


def rows(head):
    """First two cells of each row of the page's table with this head."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = text.partition(head)[2].partition("\n\n")[0]
    return [[cell.strip() for cell in line.split("|")[1:3]] for line in table.splitlines() if "`" in line]


def modules(cell):
    """Names of modules in a cell: ``pipeline.tracking`` for `pipeline/tracking.py`."""
    return [name.strip("/").replace("/", ".") for name in re.findall(r"`([\w/]+)(?:\.py)?`", cell)]


def test_rooms_are_listed_in_the_enforced_order(contracts):
    layers = contracts["A room imports only those below it"]["layers"]
    enforced = [layer.split(" | ") for layer in reversed(layers)]
    listed = [name for cell, _ in rows("| room | in | out |") for name in modules(cell)]
    assert [*listed[: listed.index("experiments")], "run"] == [name for layer in enforced for name in layer]


def test_each_heavy_package_has_the_documented_doors(contracts):
    doors = {name: modules(cell) for name, cell in rows("| package | imported only by | why |")}
    allowed = {
        name: [importer.removeprefix("sidegan.") for importer in contract["allowed_importers"]]
        for name, contract in contracts.items()
        if contract["type"] == "protected"
    }
    assert {name: sorted(x) for name, x in allowed.items()} == {name: sorted(x) for name, x in doors.items()}
