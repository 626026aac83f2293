"""The examples run, and print what they say they do."""

import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
PRINTED = {
    "regressor": "43 base parameters",
    "validity": "trajectory 1: valid\ntrajectory 2: position of joint_2",
    "excitation_set": "3 trajectories, condition number ",
    "online": "trajectory 4: the condition number of all so far is ",
    "identify_table": "nMSE of what was held out: {'shoulder': ",
}


def test_every_example_is_tested_and_short():
    files = sorted(EXAMPLES.glob("*.py"))
    assert {file.stem for file in files} == PRINTED.keys()
    assert all(len(file.read_text(encoding="utf-8").splitlines()) < 30 for file in files)


@pytest.mark.parametrize("name", PRINTED)
def test_examples_run(name, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", [f"{name}.py"])
    runpy.run_path(str(EXAMPLES / f"{name}.py"))
    assert PRINTED[name] in capsys.readouterr().out
