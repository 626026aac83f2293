"""The hostile test: what is no answer is told apart, and a sample of its bad inputs is answered."""

import json
import os
import signal
import subprocess
import sys
import time
from random import Random

import pytest

from benchmarks.hostile import __main__ as hostile
from benchmarks.hostile import joints, million, rows
from benchmarks.hostile.case import Case, outcomes
from benchmarks.hostile.configurations import command
from benchmarks.hostile.rows import Result
from sidegan.errors import ConfigError

_IN_PROCESS = 60  # of the catalogue, without commands, which take a second each
_COMMANDS = 1


def refuse(folder):
    raise ConfigError("that cannot be")


def refuse_at_length(folder):
    raise ConfigError("that cannot be,\nand here is a manual")


def break_down(folder):
    raise ZeroDivisionError("a bug")


def crash(folder):
    os.kill(os.getpid(), signal.SIGSEGV)


@pytest.mark.parametrize(
    ("act", "works", "how", "answered"),
    [
        (refuse, False, "refused", True),
        (refuse, True, "refused", False),
        (refuse_at_length, False, "many lines", False),
        (break_down, False, "traceback", False),
        (lambda folder: None, False, "accepted", False),
        (lambda folder: None, True, "accepted", True),
        (crash, False, "crash", False),
        (lambda folder: time.sleep(60), False, "no end", False),
        (lambda folder: bytearray(2**40), False, "traceback", False),
    ],
)
def test_what_is_no_answer_is_told(act, works, how, answered):
    patience = 5.0 if how == "no end" else 60.0  # with a machine that has others to serve
    first, second = outcomes([Case("bad", act, works), Case("good", refuse)], seconds=patience)
    assert (first.how, first.answered) == (how, answered)
    assert second.answered  # whatever came before


def test_a_sample_of_the_catalogue_is_answered():
    cases = rows.catalogue()
    assert len(cases) >= 250 and len({case.name for case in cases}) == len(cases)
    commands = [case for case in cases if case.name.startswith("command: +exp")]
    others = [case for case in cases if not case.name.startswith("command")]
    chosen = [*Random(1).sample(others, _IN_PROCESS), *Random(1).sample(commands, _COMMANDS)]
    wrong = {one.name: (one.how, one.words) for one in outcomes(chosen, seconds=120.0) if not one.answered}
    assert not wrong


@pytest.mark.parametrize(
    "words",
    ["seed=${oc.env:NO_SUCH_VARIABLE}", "robot.name=${robot.name}", "gan=[]", "=3"],
)
def test_what_leads_nowhere_on_the_command_line_is_one_line(words, tmp_path):
    with pytest.raises(ConfigError):
        command(f"+experiment=exp1 {words}", tmp_path)


def test_a_reader_that_has_seen_enough_ends_the_command_without_a_word():
    process = subprocess.Popen(
        [sys.executable, "-m", "sidegan.run", "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait() == 1


def test_a_row_knows_whether_its_goal_is_reached(monkeypatch):
    monkeypatch.setitem(rows.ABOUT, "share", {"unit": "x", "more": True, "goal": 1.0})
    monkeypatch.setitem(rows.ABOUT, "cost", {"unit": "y", "more": False, "goal": 2.0})
    assert rows.row("share", Result(1.0))["reached"] and not rows.row("share", Result(0.99))["reached"]
    assert rows.row("cost", Result(2.0))["reached"] and not rows.row("cost", Result(2.1))["reached"]


def test_the_command_prints_and_writes_its_rows(monkeypatch, tmp_path, capsys):
    cases = [Case("good", refuse), Case("bad", break_down)]
    monkeypatch.setattr(rows, "catalogue", lambda: cases)
    arguments = ["--only", "bad_inputs", "--json", str(tmp_path / "x.json")]
    assert hostile.main(arguments) == 1
    (row,) = json.loads((tmp_path / "x.json").read_text())["rows"]
    assert row["ours"] == 0.5 and not row["reached"] and row["also"]["bad"].startswith("traceback: Zero")
    assert "bad_inputs" in capsys.readouterr().out
    cases.pop()
    assert hostile.main(arguments) == 0


def test_many_joints_are_worked_with_or_refused():
    found = joints.measured(joints.FEW)
    few, many = (found[count][0] for count in joints.FEW)
    assert few.endswith("of 10 valid") and many.startswith(joints.REFUSED)


def test_a_large_library_is_measured(monkeypatch):
    monkeypatch.setattr(million, "FEW", 400)
    row = rows.row("million_library", rows.million_library(small=True))
    assert row["also"]["400 trajectories: file [GB]"] > row["also"]["100 trajectories: file [GB]"] > 0
    assert row["ours"] > 0.1 and row["also"]["million made (1), or extrapolated (0)"] == 0


def test_every_row_is_described():
    assert set(rows.ABOUT) == set(rows.ROWS)
