"""MLflow gets all of runs and sweeps; a server that is away costs nothing but that."""

import json
import logging
import shutil
import sys
from pathlib import Path

import pandas as pd
import pytest
from mlflow import MlflowClient

from sidegan.errors import InfeasibleError
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.sweep import job_results, leave_results, sweep_table
from sidegan.pipeline.tracking import Tracker
from tests.pipeline.conftest import NOWHERE, client_of


def called(root, name):
    """The runs of a name."""
    client = client_of(root)
    number = client.get_experiment_by_name("exp1").experiment_id
    return client.search_runs([number], f"attributes.run_name = '{name}'")


def warnings(caplog):
    return [x.getMessage() for x in caplog.records if x.levelno >= logging.WARNING]


def record(tracker, folder):
    """Some of everything, as a run records it."""
    (folder / "plots").mkdir()
    (folder / "plots" / "loss.svg").write_text("<svg/>")
    many = {f"n{k}": k for k in range(150)}
    tracker.log_params({"seed": 1, "gan": {"eigen": {"epochs": 3}}, "stages": ["seeds"], "many": many})
    tracker.log_history({"loss": [3.0, None, 2.0], "many": [float(i) for i in range(2500)]})
    tracker.log_metrics({"R² of λ_1, spectrum": 0.9})
    tracker.log_artifact(folder / "plots", "figures")
    tracker.log_table(pd.DataFrame({"nmse": [0.1]}, index=pd.Index(["seeds"], name="set")), "table1")
    for note in ("**Table I**", "x" * 8000, "the end"):  # as much as there is room for
        tracker.log_note(note)
    tracker.log_metrics({"success": 0.7}, tracker.log_model("gan/eigen 0", "abc", folder / "plots"))


def test_a_run_is_recorded_completely(root, tmp_path):
    with Tracker(root, "exp1", "whole") as tracker:
        record(tracker, tmp_path)
    with Tracker(root, "exp1", "again") as again:
        assert again.log_model("gan/eigen 0", "abc", tmp_path / "plots") is None, "a model is recorded once"
    client, (found,) = client_of(root), called(root, "whole")
    assert client.get_run(again.run_id).outputs.model_outputs == found.outputs.model_outputs
    assert found.info.status == "FINISHED" and found.info.artifact_uri.startswith(root.as_uri())
    expected = {"seed": "1", "gan.eigen.epochs": "3", "stages": "['seeds']", "many.n149": "149"}
    assert expected.items() <= found.data.params.items() and len(found.data.params) == 153
    assert found.data.metrics["R² of λ_1_ spectrum"] == 0.9
    assert found.data.tags["mlflow.note.content"] == "**Table I**\n\nthe end\n\n"
    loss = client.get_metric_history(found.info.run_id, "loss")
    assert [(m.step, m.value) for m in loss] == [(0, 3.0), (2, 2.0)]
    assert len(client.get_metric_history(found.info.run_id, "many")) == 2500
    (drawn,) = client.list_artifacts(found.info.run_id, "figures")
    table = json.loads(Path(client.download_artifacts(found.info.run_id, "table1.json")).read_text())
    assert drawn.path == "figures/loss.svg"
    assert table == {"columns": ["set", "nmse"], "data": [["seeds", 0.1]]}
    model = client.get_logged_model(found.outputs.model_outputs[0].model_id)
    assert model.name == "gan-eigen-0" and [(x.key, x.value) for x in model.metrics] == [("success", 0.7)]
    assert [file.path for file in client.list_logged_model_artifacts(model.model_id)] == ["loss.svg"]


def test_an_unreachable_tracking_server_gives_one_warning(root, tmp_path, caplog):
    with Tracker(root, "exp1", "away", NOWHERE) as tracker:
        record(tracker, tmp_path)
    (warning,) = warnings(caplog)
    assert "continues without MLflow" in warning and "refused" in warning and "\n" not in warning


@pytest.mark.parametrize("chosen", ["off", "auto"])
def test_without_tracking_or_mlflow_nothing_is_said(tmp_path, monkeypatch, caplog, chosen):
    """To those who did not ask for it; with off it is not even imported."""
    monkeypatch.setitem(sys.modules, "mlflow", None)  # an import is an error
    with Tracker(tmp_path, "exp1", "bare", chosen) as tracker:
        tracker.log_metrics({"nmse": 1})
        assert not tracker.enabled
    assert not caplog.records and not list(tmp_path.iterdir())


class Lost:
    """Records on their way to a server that is gone."""

    def wait(self):
        raise ConnectionError("the server is gone")


def test_a_server_lost_midway_gives_one_warning_and_keeps_earlier_metrics(root, caplog, monkeypatch):
    with Tracker(root, "exp1", "interrupted") as tracker:
        tracker.log_metrics({"before": 1.0})
        with monkeypatch.context() as patch:
            patch.setattr(MlflowClient, "log_batch", lambda *_, **__: Lost())
            tracker.log_metrics({"after": 2.0})
    (warning,) = warnings(caplog)
    assert "the server is gone" in warning
    assert client_of(root).get_run(tracker.run_id).data.metrics == {"before": 1.0}


@pytest.mark.parametrize(("error", "status"), [(ValueError, "FAILED"), (KeyboardInterrupt, "KILLED")])
def test_the_recorded_status_is_that_of_the_run(root, error, status):
    with pytest.raises(error), Tracker(root, "exp1", status) as tracker:
        raise error
    assert client_of(root).get_run(tracker.run_id).info.status == status


def test_an_interrupt_while_the_database_is_made_leaves_no_half_of_it(tmp_path, database, monkeypatch):
    def interrupted(uri):
        Path(uri.removeprefix("sqlite:///")).write_text("half")
        raise KeyboardInterrupt

    def made(uri):
        file = Path(uri.removeprefix("sqlite:///"))
        if file.name != "mlflow.db":
            assert not file.exists(), "half a database would be taken for a whole one"
            shutil.copy(database, file)
        return MlflowClient(uri)

    monkeypatch.setattr("mlflow.MlflowClient", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Tracker(tmp_path, "exp1", "first")
    monkeypatch.setattr("mlflow.MlflowClient", made)
    assert Tracker(tmp_path, "exp1", "second").run_id


def test_a_sweep_is_recorded_as_parent_with_children_and_table(command, root, monkeypatch):
    def fail_on_odd_seeds(context, tracker):
        tracker.log_history({"fitness": [3.0, 2.0]})
        leave_results(pd.DataFrame({"nMSE": [0.5]}, index=["seeds"]), context.store.run_folder)
        if context.cfg.seed % 2:
            raise InfeasibleError("no start became valid")

    monkeypatch.setattr("sidegan.pipeline.stages.stage", lambda name: Stage(show=fail_on_odd_seeds))
    words = "stages=[odd]", "seed=0,1", "gan=eigen"
    assert command("-m", *words, f"outputs={root}", tracking="local") == 1
    (parent,) = called(root, "exp1 sweep stages=[odd] seed=0,1 gan=eigen tracking=local")
    assert parent.info.status == "FAILED"
    (sweep,) = root.glob("runs/exp1/sweep_*")
    assert pd.read_csv(sweep / "sweep.csv").to_dict("list") == {"name": ["seeds"], "nMSE": [0.5]}
    numbers = pd.read_csv(sweep / "sweep_results.csv").set_index("name").loc["seeds"]
    assert (numbers.nMSE, numbers.seed) == (0.5, 0) and (sweep / numbers.job / "results.csv").is_file()
    assert "sweep.json" in [file.path for file in client_of(root).list_artifacts(parent.info.run_id)]
    number, of_parent = parent.info.experiment_id, f"tags.mlflow.parentRunId = '{parent.info.run_id}'"
    children = client_of(root).search_runs([number], of_parent)
    ended = {child.info.run_name: child.info.status for child in children}
    assert ended == {
        f"exp1 stages=[odd] gan=eigen seed={k}": end for k, end in enumerate(("FINISHED", "FAILED"))
    }
    for child in children:
        assert child.data.metrics["fitness"] == 2.0
        assert child.data.params["gan.eigen._target_"] == "sidegan.gan.variants.Eigen"


def left(sweep, number, seed, width, nmse):
    """A job's folder, with what it overrides and its results."""
    folder = sweep / f"{number}_job"
    (folder / ".hydra").mkdir(parents=True)
    lines = [f"seed={seed}", f"gan.generator.width={width}", "+experiment=exp1", "~trajectory.home"]
    (folder / ".hydra" / "overrides.yaml").write_text(json.dumps(lines))
    table = pd.DataFrame({"nMSE": [nmse, 2 * nmse], "rank": [7.0, None]}, index=["seeds", "eigen"])
    table.rename_axis("name").to_csv(folder / "results.csv")
    return folder


def test_the_sweep_table_averages_over_seeds(tmp_path):
    jobs = [(0, 16, 0.1), (1, 16, 0.3), (0, 32, 0.5), (1, 32, 0.5)]
    folders = [left(tmp_path, number, *job) for number, job in enumerate(jobs)]
    table = sweep_table(folders)
    assert table.index.names == ["gan.generator.width", "name"]
    assert table.index.to_list() == [("16", "seeds"), ("16", "eigen"), ("32", "seeds"), ("32", "eigen")]
    assert table["nMSE"].to_list() == ["0.2 ± 0.14", "0.4 ± 0.28", "0.5 ± 0", "1 ± 0"]
    assert table["rank"].to_list() == ["7 ± 0", "—", "7 ± 0", "—"]
    assert sweep_table(folders[::2])["nMSE"].to_list() == ["0.1", "0.2", "0.5", "1"]
    assert sweep_table(folders[:2]).index.to_list() == ["seeds", "eigen"], "only seeds differ"
    numbers = job_results(folders)
    assert numbers[numbers.name == "eigen"].nMSE.tolist() == [0.2, 0.6, 1.0, 1.0]
    assert numbers.seed.tolist() == ["0", "0", "1", "1"] * 2 and numbers.job.iloc[-1] == "3_job"
    assert sweep_table([tmp_path]) is None and sweep_table([]) is None
