"""Settings in messages: what is suggested can be typed, in a command and in Python."""

import shlex

import pytest

from sidegan.base.settings_text import FILL_IN, command_messages, suggestion
from sidegan.cell import Cell
from sidegan.pipeline.compose import composed
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.store import Store

SUGGESTED = [
    ("robot.effort", 0.5),
    ("robot.limits.velocity", {"shoulder": 1.25, "elbow": 2.0}),
    ("robot.may_touch", [("base", "forearm")]),
    ("robot.friction", False),
    ("trajectory.home", [0.1, -0.2]),
    ("workspace.clearance", 0.01),
    ("workspace.torque", False),
    ("workspace.regions", [{"plane": {"normal": [0, 0, 1], "offset": -0.5}}]),
    ("workspace", "free"),
]


@pytest.mark.parametrize(("name", "value"), SUGGESTED, ids=[name for name, _ in SUGGESTED])
def test_a_suggestion_means_the_same_in_a_command_and_in_python(tmp_path, name, value):
    cell = eval(f"Cell('planar2', {suggestion(name, value)})")
    with command_messages():
        words = shlex.split(suggestion(name, value))
    given = RunContext(composed("+experiment=excite", "robot=planar2", *words), Store(tmp_path)).cell
    assert cell.whole_arm.digest == given.whole_arm.digest
    assert (cell.effort, cell.home) == (given.effort, given.home)
    assert cell.workspace.shapes(cell.arm) == given.workspace.shapes(given.arm)
    assert (cell.workspace.torque, cell.workspace.clearance) == (
        given.workspace.torque,
        given.workspace.clearance,
    )
    assert cell.setup == given.setup


def test_notes_name_settings_as_their_reader_writes_them():
    cell = Cell("planar2")
    with command_messages():
        of_the_command = cell.notes
    for words, argument in zip(of_the_command, cell.notes):
        named = words.replace("robot.effort=", "effort=").replace("workspace.clearance=", "clearance=")
        assert named == argument
    assert f"robot.effort={FILL_IN}" in of_the_command[0]
