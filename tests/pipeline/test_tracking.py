import json
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest

from sidegan.pipeline import tracking
from sidegan.pipeline.tracking import UNTRACKED, Tracker
from sidegan.untracked import main as send_all
from tests.pipeline.conftest import NOWHERE, client_of


@pytest.fixture
def start(root, tmp_path):
    def started(**more):
        return Tracker(root, tmp_path, "exp1", more.pop("name", "exp1 eigen seed=1"), **more)

    return started


def untracked(folder):
    path = folder / UNTRACKED
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def test_a_run_is_recorded_with_everything_and_inside_the_outputs(root, start, tmp_path):
    (tmp_path / "table.csv").write_text("a,b")
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "loss.svg").write_text("<svg/>")
    table = pd.DataFrame({"nmse": [0.1, 0.2]}, index=pd.Index(["seeds", "both"], name="set"))
    with start() as tracker:
        tracker.log_params({"seed": 1, "gan": {"eigen": {"weights": {"fitness": 0.1}}}, "stages": ["seeds"]})
        tracker.log_history({"loss": [3.0, 2.0, 1.0], "valid share": [0.1, 0.5, 0.9]})
        tracker.log_history({"late": [1.0, 2.0]}, steps=[10, 20])
        tracker.log_metrics({"R² of λ_1, spectrum": 0.9})
        tracker.log_artifact(tmp_path / "table.csv")
        tracker.log_artifact(tmp_path / "plots", "figures")
        tracker.log_table(table, "table1")
    client = client_of(root)
    run = client.get_run(tracker.run_id)
    assert run.info.status == "FINISHED"
    assert run.info.run_name == "exp1 eigen seed=1"
    assert client.get_experiment(run.info.experiment_id).name == "exp1"
    assert run.info.artifact_uri.startswith(root.as_uri())
    assert run.data.params == {"seed": "1", "gan.eigen.weights.fitness": "0.1", "stages": "['seeds']"}
    assert run.data.metrics["R² of λ_1_ spectrum"] == 0.9
    steps = {
        name: [(m.step, m.value) for m in client.get_metric_history(tracker.run_id, name)]
        for name in ("loss", "late")
    }
    assert steps == {"loss": [(0, 3.0), (1, 2.0), (2, 1.0)], "late": [(10, 1.0), (20, 2.0)]}
    files = [
        file.path for folder in (None, "figures") for file in client.list_artifacts(tracker.run_id, folder)
    ]
    assert {"table.csv", "figures/loss.svg", "table1.json"} <= set(files)
    shown = json.loads(Path(client.download_artifacts(tracker.run_id, "table1.json")).read_text())
    assert shown == {"columns": ["set", "nmse"], "data": [["seeds", 0.1], ["both", 0.2]]}
    assert untracked(tmp_path) == []


def test_more_numbers_and_settings_than_mlflow_takes_at_once(root, start):
    with start() as tracker:
        tracker.log_history({"loss": [float(i) for i in range(2500)]})
        tracker.log_params({f"setting{i}": i for i in range(250)})
        tracker.log_params({"long": "x" * 10_000})
    client = client_of(root)
    assert len(client.get_metric_history(tracker.run_id, "loss")) == 2500
    assert len(client.get_run(tracker.run_id).data.params) == 251


@pytest.mark.parametrize(("error", "status"), [(ValueError, "FAILED"), (KeyboardInterrupt, "KILLED")])
def test_a_run_ends_as_its_block_does(root, start, error, status):
    with pytest.raises(error), start() as tracker:
        raise error
    assert client_of(root).get_run(tracker.run_id).info.status == status


KILLED = """
import os, signal, sys
from pathlib import Path
from sidegan.pipeline.tracking import Tracker
tracker = Tracker(Path(sys.argv[1]), Path(sys.argv[1]), "exp1", "killed")
print(tracker.run_id, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_run_whose_process_was_killed_is_marked_by_the_next_one(root, start):
    killed = subprocess.run([sys.executable, "-c", KILLED, str(root)], capture_output=True, text=True).stdout
    with start(name="beside") as beside:
        client = client_of(root)
        assert client.get_run(killed.strip()).info.status == "KILLED"
        with start(name="another"):
            assert client.get_run(beside.run_id).info.status == "RUNNING"
    assert client.get_run(beside.run_id).info.status == "FINISHED"
    assert not list((root / ".locks").glob("run-*.lock"))


def test_the_description_of_a_run_has_what_there_is_room_for(root, start):
    with start() as tracker:
        for note in ("**Table I**\n\n| a |\n| ---: |\n| 1 |", "x" * 8000, "the end"):
            tracker.log_note(note)
    note = client_of(root).get_run(tracker.run_id).data.tags["mlflow.note.content"]
    assert note == "**Table I**\n\n| a |\n| ---: |\n| 1 |\n\nthe end\n\n"


def test_a_run_may_be_part_of_another(root, start):
    with start(name="sweep") as parent, start(parent=parent.run_id) as child:
        pass
    tags = client_of(root).get_run(child.run_id).data.tags
    assert tags["mlflow.parentRunId"] == parent.run_id


def test_a_server_that_is_gone_stops_nothing_and_nothing_is_lost(start, tmp_path, caplog):
    with start(uri=NOWHERE) as tracker:
        tracker.log_params({"seed": 1})
        tracker.log_metrics({"nmse": 0.5})
        tracker.log_artifact(tmp_path / "table.csv")
        tracker.log_table(pd.DataFrame({"a": [1]}), "table1")
    warnings = [record.message for record in caplog.records if record.name == "sidegan.pipeline.tracking"]
    assert len(warnings) == 1 and "tracking stops" in warnings[0] and UNTRACKED in warnings[0]
    kept = untracked(tmp_path)
    assert [line["kind"] for line in kept] == ["run", "params", "metrics", "artifact", "table", "status"]
    assert kept[0]["content"]["name"] == "exp1 eigen seed=1"
    assert kept[2]["content"][0][:2] == ["nmse", 0.5]
    assert kept[4]["content"]["table"] == {"columns": ["a"], "data": [[1]]}


def test_a_server_that_goes_away_in_the_middle_stops_nothing(start, tmp_path, caplog, monkeypatch):
    with start() as tracker:

        def gone(*arguments, **more):
            raise ConnectionError("the server is gone")

        tracker.log_metrics({"nmse": 0.5})
        monkeypatch.setattr(tracker._client, "log_batch", gone)
        tracker.log_metrics({"nmse": 0.4})
        tracker.log_metrics({"nmse": 0.3})
    assert caplog.text.count("the server is gone") == 1
    kept = untracked(tmp_path)
    assert [line["kind"] for line in kept] == ["metrics", "metrics", "status"]
    assert {line["run"] for line in kept} == {tracker.run_id}


@contextmanager
def full_database():
    """Within the block no SQLite database grows, as on a full disk."""
    from sqlalchemy import event
    from sqlalchemy.engine import Engine

    def limit(connection, cursor, *rest):
        connection.connection.driver_connection.execute("PRAGMA max_page_count = 1")  # SQLite: as it is

    event.listen(Engine, "before_cursor_execute", limit)
    try:
        yield
    finally:
        event.remove(Engine, "before_cursor_execute", limit)


def test_a_full_disk_is_told_in_one_line_and_nothing_is_lost(root, start, tmp_path, caplog, capfd):
    numbers = {f"number {k}": float(k) for k in range(3000)}
    with start() as tracker:
        with full_database():
            tracker.log_metrics(numbers)
        tracker.log_metrics({"last": 1.0})
    (warning,) = [x.getMessage() for x in caplog.records if x.name.startswith("sidegan")]
    assert "disk is full" in warning and "\n" not in warning
    assert "Traceback" not in (printed := "".join(capfd.readouterr())) and "SQLAlchemy" not in printed
    assert [record["kind"] for record in untracked(tmp_path)] == ["metrics", "metrics", "status"]


def test_where_nothing_can_be_kept_either_that_is_told_once(root, tmp_path, caplog):
    folder = tmp_path / "gone"
    with Tracker(root, folder, "exp1", "x", uri=NOWHERE) as tracker:
        tracker.log_metrics({"a": 1.0})
    warnings = [x.getMessage() for x in caplog.records if x.name.startswith("sidegan")]
    assert len(warnings) == 2 and "cannot be written (No such file or directory)" in warnings[1]


def test_a_run_folder_that_cannot_be_written_stops_nothing_either(root, tmp_path):
    with Tracker(root, tmp_path / "missing", "exp1", "name", NOWHERE) as tracker:
        tracker.log_metrics({"nmse": 0.5})


SHORT = """
import sys
from pathlib import Path
from sidegan.pipeline.tracking import Tracker
root = Path(sys.argv[1])
with Tracker(root, root / "short", "exp1", "short", patience=600) as tracker:
    tracker.log_params({"seed": 1})
    tracker.log_artifact(root / "short" / "table.csv")
assert "mlflow" not in sys.modules
"""


def test_a_short_run_is_recorded_when_it_has_ended_by_another_process(root):
    (root / "short").mkdir()
    (root / "short" / "table.csv").write_text("a,b")
    subprocess.run([sys.executable, "-c", SHORT, str(root)], check=True, timeout=600)
    until = time.monotonic() + 300
    while len(list((root / "short").iterdir())) > 1 and time.monotonic() < until:
        time.sleep(0.5)
    assert [path.name for path in (root / "short").iterdir()] == ["table.csv"], "nothing is kept any more"
    client = client_of(root)
    (run,) = client.search_runs(["1"], "attributes.run_name = 'short'")
    assert run.info.status == "FINISHED" and run.data.params == {"seed": "1"}
    assert [file.path for file in client.list_artifacts(run.info.run_id)] == ["table.csv"]


def test_an_interrupted_short_run_is_recorded_too(root, start, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(tracking.subprocess, "Popen", lambda command, **how: asked.append((command, how)))
    with pytest.raises(KeyboardInterrupt), start(name="stopped", patience=600) as tracker:
        tracker.log_metrics({"nmse": 0.5})
        raise KeyboardInterrupt
    ((command, how),) = asked
    assert how["start_new_session"], "Ctrl-C is for everything that a terminal has started"
    assert [record["kind"] for record in untracked(tmp_path)] == ["run", "metrics", "status"]
    assert command[1:3] == ["-m", "sidegan.untracked"] and send_all(command[3:]) == 0
    (run,) = client_of(root).search_runs(["1"], "attributes.run_name = 'stopped'")
    assert run.info.status == "KILLED" and run.data.metrics == {"nmse": 0.5}


def test_a_run_that_takes_longer_is_recorded_as_it_goes(root, start, tmp_path):
    with start(patience=1e-9) as tracker:
        tracker.log_metrics({"nmse": 0.5})
        assert client_of(root).get_run(tracker.run_id).data.metrics == {"nmse": 0.5}
        tracker.log_metrics({"nmse": 0.4})
    run = client_of(root).get_run(tracker.run_id)
    assert run.info.status == "FINISHED" and run.data.metrics == {"nmse": 0.4}
    assert list(tmp_path.iterdir()) == []


def test_a_short_run_whose_folder_cannot_be_written_is_recorded_at_once(root, tmp_path):
    with Tracker(root, tmp_path / "missing", "exp1", "homeless", patience=600) as tracker:
        tracker.log_metrics({"nmse": 0.5})
    assert client_of(root).get_run(tracker.run_id).data.metrics == {"nmse": 0.5}


def test_without_tracking_mlflow_is_not_even_imported(tmp_path):
    code = (
        "import sys; from pathlib import Path; from sidegan.pipeline.tracking import Tracker\n"
        f"here = Path({str(tmp_path)!r})\n"
        "with Tracker(here, here, 'experiment', 'name', enabled=False) as tracker:\n"
        "    tracker.log_params({'a': 1}); tracker.log_metrics({'b': 2})\n"
        "assert 'mlflow' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=600)
    assert list(tmp_path.iterdir()) == []
