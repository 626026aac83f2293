"""What MLflow gets of runs and sweeps, and what is kept where it cannot be reached."""

import json
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from contextlib import contextmanager, suppress
from pathlib import Path

import pandas as pd
import pytest
from sqlalchemy import event
from sqlalchemy.engine import Engine

from sidegan.errors import InfeasibleError
from sidegan.pipeline import tracking
from sidegan.pipeline.callbacks import PARENT
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.sweep import sweep_table
from sidegan.pipeline.tracking import SENDING, UNTRACKED, Tracker
from sidegan.untracked import main as send_all
from sidegan.untracked import send_kept
from tests.pipeline.conftest import NOWHERE, client_of
from tests.tiny import TINY
from tests.waiting import wait_until

FORK = multiprocessing.get_context("fork")


@pytest.fixture
def start(root, tmp_path):
    """A run whose own folder is the test's."""

    def started(folder=tmp_path, name="exp1 eigen seed=1", **more):
        return Tracker(root, folder, "exp1", name, **more)

    return started


def untracked(folder):
    path = folder / UNTRACKED
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def called(root, name):
    """The runs of a name."""
    client = client_of(root)
    number = client.get_experiment_by_name("exp1").experiment_id
    return client.search_runs([number], f"attributes.run_name = '{name}'")


def warnings(caplog):
    return [x.getMessage() for x in caplog.records if x.name.startswith("sidegan")]


@contextmanager
def listening(name, told):
    """Within the block a function is called at every event of a name of all databases."""
    event.listen(Engine, name, told)
    try:
        yield
    finally:
        event.remove(Engine, name, told)


def record(tracker, folder):
    """Some of everything, as a run records it."""
    (folder / "plots").mkdir(exist_ok=True)
    (folder / "plots" / "loss.svg").write_text("<svg/>")
    params = {"seed": 1, "gan": {"eigen": {"epochs": 3}}, "stages": ["seeds"], "long": "x" * 10_000}
    tracker.log_params(params)
    tracker.log_history({"loss": [3.0, 2.0]}, steps=[10, 20])
    tracker.log_history({"many": [float(i) for i in range(2500)]})
    tracker.log_metrics({"R² of λ_1, spectrum": 0.9})
    tracker.log_artifact(folder / "plots", "figures")
    tracker.log_table(pd.DataFrame({"nmse": [0.1]}, index=pd.Index(["seeds"], name="set")), "table1")
    for note in ("**Table I**", "x" * 8000, "the end"):  # as much as there is room for
        tracker.log_note(note)


def refuse_incomplete(root, name):
    """The run of a name must have all that ``record`` records."""
    client, (found,) = client_of(root), called(root, name)
    assert found.info.status == "FINISHED" and found.data.params.pop("long")
    assert found.data.params == {"seed": "1", "gan.eigen.epochs": "3", "stages": "['seeds']"}
    assert found.data.metrics["R² of λ_1_ spectrum"] == 0.9
    assert found.data.tags["mlflow.note.content"] == "**Table I**\n\nthe end\n\n"
    loss = client.get_metric_history(found.info.run_id, "loss")
    assert [(m.step, m.value) for m in loss] == [(10, 3.0), (20, 2.0)]
    assert len(client.get_metric_history(found.info.run_id, "many")) == 2500
    (drawn,) = client.list_artifacts(found.info.run_id, "figures")
    table = json.loads(Path(client.download_artifacts(found.info.run_id, "table1.json")).read_text())
    assert drawn.path == "figures/loss.svg"
    assert table == {"columns": ["set", "nmse"], "data": [["seeds", 0.1]]}


def test_a_run_is_recorded_with_everything_and_inside_the_outputs(root, start, tmp_path):
    with start(name="sweep") as parent, start(name="whole", parent=parent.run_id) as tracker:
        record(tracker, tmp_path)
    refuse_incomplete(root, "whole")
    whole = client_of(root).get_run(tracker.run_id)
    assert whole.data.tags["mlflow.parentRunId"] == parent.run_id
    assert whole.info.artifact_uri.startswith(root.as_uri()) and untracked(tmp_path) == []


def killed(root, pipe):
    pipe.send(Tracker(root, root, "exp1", "killed").run_id)
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_run_whose_process_was_killed_is_marked_by_the_next_one(root, start):
    mine, theirs = multiprocessing.Pipe()
    process = FORK.Process(target=killed, args=(root, theirs))
    process.start()
    process.join()
    with start(name="beside") as beside:
        client = client_of(root)
        assert client.get_run(mine.recv()).info.status == "KILLED"
        with start(name="another"):
            assert client.get_run(beside.run_id).info.status == "RUNNING"
    assert client.get_run(beside.run_id).info.status == "FINISHED"
    assert not list((root / ".locks").glob("run-*.lock"))


def recorded(root, name):
    with Tracker(root, root, "exp1", name) as tracker:
        tracker.log_metrics({"nmse": 0.5})
    return tracker


def test_two_processes_that_record_for_the_first_time_make_one_database(tmp_path):
    """And it waits for the disk again once it is made."""
    opened = []
    beside = FORK.Process(target=recorded, args=(tmp_path, "second"))
    with listening("connect", lambda connection, _: opened.append(connection)):
        beside.start()
        assert recorded(tmp_path, "first").reached
        beside.join()
    ended = {one.info.run_name: one.info.status for one in client_of(tmp_path).search_runs(["1"])}
    assert ended == {"first": "FINISHED", "second": "FINISHED"}
    assert {connection.execute("PRAGMA synchronous").fetchone()[0] for connection in opened} == {2}


def test_what_a_server_that_is_gone_did_not_get_is_sent_later_and_once(root, start, caplog, monkeypatch):
    folder = root / "runs" / "late"
    folder.mkdir(parents=True)
    with start(folder, "late", uri=NOWHERE) as tracker:
        record(tracker, folder)
    (warning,) = warnings(caplog)
    assert "tracking stops" in warning and UNTRACKED in warning
    kept = (folder / UNTRACKED).read_text()
    first, *_, last = untracked(folder)
    assert not send_kept(folder, root, NOWHERE) and send_all([str(root), "--uri", NOWHERE]) == 1
    assert (folder / UNTRACKED).read_text() == kept

    def gone(*arguments):
        raise ConnectionError("the server is gone")

    with monkeypatch.context() as patch:
        patch.setattr(tracking, "_upload", gone)
        assert not send_kept(folder, root)
    rest, (late,) = untracked(folder), called(root, "late")
    assert [line["kind"] for line in rest] == ["artifact", "table", "note", "note", "status"]
    assert {line["run"] for line in rest} == {late.info.run_id} and late.info.status == "RUNNING"
    with (folder / UNTRACKED).open("a") as file:
        file.write('{"time": 1, "ki')  # killed while it wrote
    (folder / UNTRACKED).rename(folder / SENDING)  # killed while it was sent
    assert send_all([str(root)]) == 0
    refuse_incomplete(root, "late")
    (late,) = called(root, "late")
    times = late.info.start_time, late.info.end_time
    assert times == (round(1000 * first["time"]), round(1000 * last["time"]))
    assert [path.name for path in folder.iterdir()] == ["plots"]
    assert send_kept(folder, root), "nothing is left to send"


@pytest.fixture
def server(root):
    """Address and process group of an MLflow server on the database of the outputs."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    command = [sys.executable, "-m", "mlflow", "server", "--workers", "1", "--port", str(port)]
    stores = ["--backend-store-uri", f"sqlite:///{root}/mlflow.db", "--artifacts-destination", str(root)]
    environment = {**os.environ, "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    with (root / "server.log").open("w") as log:
        options = {"stdout": log, "stderr": log, "env": environment, "start_new_session": True}
        process = subprocess.Popen([*command, *stores], **options)

    def ready():
        assert process.poll() is None
        with suppress(OSError):
            urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=1).close()
            return True

    wait_until(ready, 300)
    yield f"http://127.0.0.1:{port}", process.pid
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@pytest.mark.slow
def test_a_server_killed_in_the_middle_gets_the_rest_later(root, server, start, tmp_path, caplog):
    uri, group = server
    with start(name="interrupted", uri=uri) as tracker:
        tracker.log_metrics({"before": 1.0})
        assert tracker.reached
        os.killpg(group, signal.SIGKILL)
        tracker.log_metrics({"after": 2.0})
        tracker.log_params({"seed": 1})
    assert len(warnings(caplog)) == 1
    client = client_of(root)
    assert client.get_run(tracker.run_id).info.status == "RUNNING"
    assert send_kept(tmp_path, root)
    found = client.get_run(tracker.run_id)
    assert found.info.status == "FINISHED" and found.data.metrics == {"before": 1.0, "after": 2.0}


def test_a_full_disk_is_told_in_one_line_and_nothing_is_lost(start, tmp_path, caplog, capfd):
    limited = []

    def limit(connection, *rest):
        limited.append(connection.connection.driver_connection)
        limited[-1].execute("PRAGMA max_page_count = 1")  # SQLite: as it is

    with start() as tracker:
        with listening("before_cursor_execute", limit):
            tracker.log_metrics({f"number {k}": float(k) for k in range(3000)})
        for connection in limited:
            connection.execute("PRAGMA max_page_count = 1000000")
        tracker.log_metrics({"last": 1.0})
    (warning,) = warnings(caplog)
    assert "disk is full" in warning and "\n" not in warning
    assert "Traceback" not in (printed := "".join(capfd.readouterr())) and "SQLAlchemy" not in printed
    assert [line["kind"] for line in untracked(tmp_path)] == ["metrics", "metrics", "status"]


def test_where_nothing_can_be_kept_either_that_is_told_once(root, start, tmp_path, caplog):
    with start(tmp_path / "gone", uri=NOWHERE) as tracker:
        tracker.log_metrics({"a": 1.0})
    told = warnings(caplog)
    assert len(told) == 2 and "cannot be written (No such file or directory)" in told[1]
    with start(tmp_path / "gone", patience=600) as tracker:  # which would be kept until its end
        tracker.log_metrics({"nmse": 0.5})
    assert client_of(root).get_run(tracker.run_id).data.metrics == {"nmse": 0.5}


SHORT = """
import sys
from pathlib import Path
from sidegan.pipeline.tracking import Tracker
root, folder = Path(sys.argv[1]), Path(sys.argv[2])
with Tracker(folder, folder, "exp1", "off", enabled=False) as tracker:
    tracker.log_metrics({"nmse": 1})
assert [path.name for path in folder.iterdir()] == ["table.csv"]
with Tracker(root, folder, "exp1", "short", patience=600) as tracker:
    tracker.log_params({"seed": 1})
    tracker.log_artifact(folder / "table.csv")
assert "mlflow" not in sys.modules
"""


def test_a_short_run_is_recorded_when_it_has_ended_by_another_process(root, tmp_path):
    (tmp_path / "table.csv").write_text("a,b")
    subprocess.run([sys.executable, "-c", SHORT, str(root), str(tmp_path)], check=True, timeout=600)
    wait_until(lambda: [path.name for path in tmp_path.iterdir()] == ["table.csv"], 300)
    (short,) = called(root, "short")
    assert short.info.status == "FINISHED" and short.data.params == {"seed": "1"}
    assert [file.path for file in client_of(root).list_artifacts(short.info.run_id)] == ["table.csv"]


def test_an_interrupted_short_run_is_recorded_too(root, start, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(tracking.subprocess, "Popen", lambda command, **how: asked.append((command, how)))
    with pytest.raises(KeyboardInterrupt), start(name="stopped", patience=600) as tracker:
        tracker.log_metrics({"nmse": 0.5})
        raise KeyboardInterrupt
    ((command, how),) = asked
    assert how["start_new_session"], "Ctrl-C is for everything that a terminal has started"
    assert [line["kind"] for line in untracked(tmp_path)] == ["run", "metrics", "status"]
    assert command[1:3] == ["-m", "sidegan.untracked"] and send_all(command[3:]) == 0
    (stopped,) = called(root, "stopped")
    assert stopped.info.status == "KILLED" and stopped.data.metrics == {"nmse": 0.5}


def test_a_run_that_takes_longer_is_recorded_as_it_goes(root, start, tmp_path):
    with start(patience=1e-9) as tracker:
        for nmse in (0.5, 0.4):
            tracker.log_metrics({"nmse": nmse})
            assert client_of(root).get_run(tracker.run_id).data.metrics == {"nmse": nmse}
    assert list(tmp_path.iterdir()) == []


def test_a_sweep_is_a_parent_whose_children_end_as_they_do(command, root, monkeypatch):
    def fail_on_odd_seeds(task, tracker):
        tracker.log_history({"fitness": [3.0, 2.0]})
        if task.cfg.seed % 2:
            raise InfeasibleError("no start became valid")

    monkeypatch.setattr("sidegan.pipeline.stages.stage", lambda name: Stage(show=fail_on_odd_seeds))
    words = "stages=[odd]", "seed=0,1", "gan=eigen"
    assert command("-m", *words, f"outputs={root}", tracking="local") == 1
    (parent,) = called(root, f"exp1 sweep {' '.join(words)} tracking=local")
    assert parent.info.status == "FAILED" and PARENT not in os.environ
    number, of_parent = parent.info.experiment_id, f"tags.mlflow.parentRunId = '{parent.info.run_id}'"
    children = client_of(root).search_runs([number], of_parent)
    ended = {child.info.run_name: child.info.status for child in children}
    assert ended == {
        f"exp1 stages=[odd] gan=eigen seed={k}": end for k, end in enumerate(("FINISHED", "FAILED"))
    }
    for child in children:
        assert child.data.metrics["fitness"] == 2.0
        assert child.data.params["gan.eigen.features"] == "spectrum"


def left(sweep, number, seed, width, nmse):
    """A job's folder, with what it overrides and its results."""
    folder = sweep / f"{number}_job"
    (folder / ".hydra").mkdir(parents=True)
    lines = [f"seed={seed}", f"gan.eigen.width={width}", "+experiment=exp1", "~trajectory.home"]
    (folder / ".hydra" / "overrides.yaml").write_text(json.dumps(lines))
    table = pd.DataFrame({"nMSE": [nmse, 2 * nmse], "rank": [7.0, None]}, index=["seeds", "eigen"])
    table.rename_axis("name").to_csv(folder / "results.csv")
    return folder


def test_the_table_of_a_sweep_is_the_mean_over_seeds_of_whatever_else_is_swept(tmp_path):
    jobs = [(0, 16, 0.1), (1, 16, 0.3), (0, 32, 0.5), (1, 32, 0.5)]
    folders = [left(tmp_path, number, *job) for number, job in enumerate(jobs)]
    table = sweep_table(folders)
    assert table.index.names == ["gan.eigen.width", "name"]
    assert table.index.to_list() == [("16", "seeds"), ("16", "eigen"), ("32", "seeds"), ("32", "eigen")]
    assert table["nMSE"].to_list() == ["0.2 ± 0.14", "0.4 ± 0.28", "0.5 ± 0", "1 ± 0"]
    assert table["rank"].to_list() == ["7 ± 0", "—", "7 ± 0", "—"]
    assert sweep_table(folders[::2])["nMSE"].to_list() == ["0.1", "0.2", "0.5", "1"]
    assert sweep_table(folders[:2]).index.to_list() == ["seeds", "eigen"], "only seeds differ"
    assert sweep_table([tmp_path]) is None and sweep_table([]) is None


def test_a_study_is_a_sweep_with_one_table_over_all_jobs(command, root, outputs):
    """Experiment 2 in two readings; seeds, generators and libraries are made once for both."""
    small = [word for word in TINY if not word.startswith(("tracking", "long", "selection"))]
    words = "+experiment=exp2", "replication.reading=all,seeds", "gan=eigen"
    uri = f"tracking.uri=sqlite:///{root}/mlflow.db"
    assert command("-m", *words, *small, f"outputs={outputs}", uri, tracking="local") == 0
    (sweep,) = outputs.glob("runs/exp2/sweep_*")
    table = pd.read_csv(sweep / "sweep.csv")
    sets = "seeds ×1", "seeds ×4", "seeds ×10", "eigen"
    rows = [(reading, name) for reading in ("all", "seeds") for name in sets]
    assert list(zip(table["replication.reading"], table["name"])) == rows
    assert {"nMSE", "‖diag P‖"} <= set(table) and (sweep / "sweep.md").exists()
    client = client_of(root)
    runs = client.search_runs([client.get_experiment_by_name("exp2").experiment_id])
    (parent,) = [one for one in runs if "mlflow.parentRunId" not in one.data.tags]
    assert len(runs) == 3 and {one.info.status for one in runs} == {"FINISHED"}
    assert "sweep.json" in [file.path for file in client.list_artifacts(parent.info.run_id)]
