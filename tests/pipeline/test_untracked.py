import json

import pandas as pd
import pytest

from sidegan.pipeline import tracking
from sidegan.pipeline.tracking import UNTRACKED, Tracker
from sidegan.untracked import main, send_kept
from tests.pipeline.conftest import NOWHERE, client_of


@pytest.fixture
def folder(root, request):
    """Folder of a run below the outputs."""
    path = root / "runs" / request.node.name
    path.mkdir(parents=True)
    return path


def run_called(root, name):
    client = client_of(root)
    number = client.get_experiment_by_name("exp1").experiment_id
    (run,) = client.search_runs([number], f"attributes.run_name = '{name}'")
    return client, run


def record(tracker, folder):
    (folder / "figure.svg").write_text("<svg/>")
    tracker.log_params({"seed": 1, "gan": {"eigen": {"epochs": 3}}})
    tracker.log_history({"loss": [3.0, 2.0]}, steps=[10, 20])
    tracker.log_artifact(folder / "figure.svg", "figures")
    tracker.log_table(pd.DataFrame({"a": [1]}), "table1")


def test_a_run_that_never_reached_the_server_is_sent_later(root, folder):
    with Tracker(root, folder, "exp1", "late", NOWHERE) as tracker:
        record(tracker, folder)
    first, *_, last = map(json.loads, (folder / UNTRACKED).read_text().splitlines())
    assert send_kept(folder, root)
    client, run = run_called(root, "late")
    assert run.info.status == "FINISHED"
    assert run.info.start_time == round(1000 * first["time"])
    assert run.info.end_time == round(1000 * last["time"])
    assert run.data.params == {"seed": "1", "gan.eigen.epochs": "3"}
    history = client.get_metric_history(run.info.run_id, "loss")
    assert [(m.step, m.value) for m in history] == [(10, 3.0), (20, 2.0)]
    files = {file.path for part in (None, "figures") for file in client.list_artifacts(run.info.run_id, part)}
    assert {"figures/figure.svg", "table1.json"} <= files
    assert [path.name for path in folder.iterdir()] == ["figure.svg"]
    assert send_kept(folder, root), "nothing is left to send"


def test_a_run_whose_server_went_away_is_completed(root, folder, monkeypatch):
    with Tracker(root, folder, "exp1", "completed") as tracker:
        tracker.log_metrics({"before": 1.0})
        monkeypatch.setattr(tracker, "_client", None)
        monkeypatch.setattr(tracker, "uri", NOWHERE)
        record(tracker, folder)
    assert client_of(root).get_run(tracker.run_id).info.status == "RUNNING"
    assert send_kept(folder, root)
    run = client_of(root).get_run(tracker.run_id)
    assert run.info.status == "FINISHED"
    assert run.data.metrics == {"before": 1.0, "loss": 2.0}


def test_what_does_not_arrive_stays_kept(root, folder):
    with Tracker(root, folder, "exp1", "kept", NOWHERE) as tracker:
        record(tracker, folder)
    kept = (folder / UNTRACKED).read_text()
    assert not send_kept(folder, root, NOWHERE)
    assert (folder / UNTRACKED).read_text() == kept
    (folder / "figure.svg").unlink()
    (folder / UNTRACKED).write_text(kept + '{"time": 1, "ki')  # killed while it wrote
    (folder / UNTRACKED).rename(folder / "untracked.sending.jsonl")  # killed while it was sent
    assert main([str(root)]) == 0
    assert list(folder.iterdir()) == []
    assert run_called(root, "kept")[1].data.metrics == {"loss": 2.0}


def test_what_arrived_before_the_server_went_away_again_is_not_sent_twice(root, folder, monkeypatch):
    with Tracker(root, folder, "exp1", "twice", NOWHERE) as tracker:
        record(tracker, folder)

    def gone(*arguments):
        raise ConnectionError("the server is gone")

    with monkeypatch.context() as patch:
        patch.setattr(tracking, "_upload", gone)
        assert not send_kept(folder, root)
    kept = [json.loads(line) for line in (folder / UNTRACKED).read_text().splitlines()]
    assert [line["kind"] for line in kept] == ["artifact", "table", "status"]
    _, run = run_called(root, "twice")
    assert {line["run"] for line in kept} == {run.info.run_id} and run.info.status == "RUNNING"
    assert send_kept(folder, root)
    assert run_called(root, "twice")[1].info.status == "FINISHED"


def test_the_command_tells_what_is_still_kept(root, folder, caplog):
    caplog.set_level("INFO", "sidegan")
    with Tracker(root, folder, "exp1", "told", NOWHERE):
        pass
    assert main([str(root), "--uri", NOWHERE]) == 1
    assert "0 of 1 runs are sent" in caplog.text
    assert main([str(root)]) == 0
