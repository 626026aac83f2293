import os
import sys
from pathlib import Path

import pytest
from joblib.externals.loky.backend.synchronize import Lock

from benchmarks.hostile import kills

# Stands for the command: two artifacts, one after the other. A second start goes on from the first one.
STEADY = """
import sys, time
from pathlib import Path
outputs = Path(next(x for x in sys.argv if x.startswith("outputs=")).partition("=")[2])
log = outputs / "runs" / "exp1" / str(time.time_ns()) / "run.log"
log.parent.mkdir(parents=True)
log.write_text("sidegan.pipeline.run: seeds …\\n")
first, second = outputs / "seeds" / "a", outputs / "gan" / "b"
again = first.exists()
time.sleep(0.2)
first.parent.mkdir(exist_ok=True)
first.write_text("1")
log.write_text("sidegan.pipeline.run: seeds …\\nsidegan.pipeline.run: gan …\\n")
time.sleep(0.5)
second.parent.mkdir(exist_ok=True)
second.write_text(f"2{AGAIN if again else ''}")
"""


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Kills of a command that does so much after a first start."""

    def make(again):
        source = tmp_path / f"{again}.py"
        source.write_text(STEADY.replace("AGAIN", repr(again)))
        monkeypatch.setattr(kills, "_COMMAND", (sys.executable, str(source)))
        work = tmp_path / "work" / again
        work.mkdir(parents=True)
        return kills.Kills("planar2", work, Path.cwd())

    return make


def test_kills_that_change_nothing_are_counted_by_stage(command):
    outcome = command("").run(4)
    assert outcome.kills == 4 and outcome.finished >= 1 and not outcome.unequal
    assert sum(outcome.stages.values()) == 4 and set(outcome.stages) <= {"start", "seeds", "gan"}


def test_what_comes_out_otherwise_after_a_kill_is_named_and_kept(command):
    killed = command("!")
    while "gan/b" not in (outcome := killed.run(len(killed._told("killed")) + 1)).unequal:
        assert outcome.kills < 200, "no kill came between the two artifacts"
    (kept,) = (killed.work / "unequal").iterdir()
    assert (kept / "whole" / "gan" / "b").read_text() == "2"
    assert (kept / "torn" / "gan" / "b").read_text() == "2!"


def test_what_was_done_is_not_done_again(command, monkeypatch):
    killed = command("")
    before = killed.run(2)
    monkeypatch.setattr(kills.Kills, "_start", lambda *_: pytest.fail("started again"))
    again = kills.Kills(killed.arm, killed.work, killed.tree).run(2)
    assert again == before


def test_a_run_that_ends_before_its_kill_is_killed_at_another_moment(command, monkeypatch):
    """As where the machine was busy while the time of a whole run was taken."""
    moments, killed = [], command("")
    monkeypatch.setattr(kills.Kills, "_whole", 1000.0)

    def start(self, outputs, moment):
        moments.append(moment)
        outputs.mkdir(exist_ok=True)
        return 1, None if moment is not None and moment < 60 else 0

    monkeypatch.setattr(kills.Kills, "_start", start)
    assert killed.run(2).kills == 2
    assert len(set(moments)) == len(moments) > 3


def test_a_command_that_makes_nothing_shows_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(kills, "_COMMAND", (sys.executable, "-c", "pass"))
    outcome = kills.Kills("planar2", tmp_path, Path.cwd()).run(0)
    assert outcome.unequal == ["planar2: nothing was made"]


def test_semaphores_of_a_process_and_of_no_other_are_found():
    lock = Lock()
    made = kills.semaphores(os.getpid())
    assert f"sem.{lock._semlock.name.removeprefix('/')}" in made
    assert not set(made) & set(kills.semaphores(os.getppid()))
