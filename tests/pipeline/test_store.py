"""Artifacts appear whole, are found again, and are made anew when they are damaged."""

import errno
import json
import multiprocessing
import os
import signal
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from threadpoolctl import threadpool_info

from sidegan.base.threads import on_threads, threads
from sidegan.errors import ArtifactError, StorageError
from sidegan.pipeline import store as stores
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.run import ARTIFACTS, make_all
from sidegan.pipeline.store import Store
from tests.refusals import refused

PATIENCE = 120  # [s] to wait for another process on a busy machine


@pytest.fixture(autouse=True)
def versions(monkeypatch):
    """One maker, of numbers."""
    monkeypatch.setattr("sidegan.pipeline.artifact.versions", lambda: {"numbers": 1})


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "outputs")


def write(build):
    (build.folder / "deep").mkdir()
    (build.folder / "numbers.txt").write_text("1 2 3")
    (build.folder / "deep" / "more.txt").write_text("4 5 6")


def refuse(build):
    raise AssertionError("must not be made again")


def numbers(count=3, make=write, seed=0):
    named = {"maker": "numbers", "label": "kuka", "title": "numbers", "metrics": lambda folder: {}}
    return Artifact(**named, settings={"count": count}, inputs={}, seed=seed, make=make)


def visible(store):
    return sorted(path.name for path in store.root.glob("numbers/[!.]*"))


def test_an_artifact_is_invisible_until_complete_and_made_once(store):
    def make(build):
        write(build)
        assert store.find(numbers()) is None and not store.folder(numbers()).exists()

    folder = store.produce(numbers(make=make))
    assert (folder / "numbers.txt").read_text() == "1 2 3"
    assert Store(store.root).find(numbers()) == folder
    assert store.produce(numbers(make=refuse)) == folder == store.require(numbers())


def test_artifacts_are_made_on_one_thread(store):
    def make(build):
        most = max([threads(), *(pool["num_threads"] for pool in threadpool_info())])
        (build.folder / "numbers.txt").write_text(str(most))

    with on_threads(2):
        folder = store.produce(numbers(make=make))
        assert threads() == 2
    assert (folder / "numbers.txt").read_text() == "1"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_stopped_build_keeps_its_tasks_and_earlier_artifacts(store, error):
    before = store.produce(numbers(4))

    def stopped(build):
        write(build)
        (build.work / "task-0.txt").write_text("done")
        raise error

    with pytest.raises(error):
        store.produce(numbers(make=stopped))
    assert store.find(numbers()) is None and store.find(numbers(4)) == before
    assert visible(store) == sorted([before.name, f"{store.folder(numbers()).name}.work"])

    def goes_on(build):
        assert (build.work / "task-0.txt").read_text() == "done"
        write(build)

    folder = store.produce(numbers(make=goes_on))
    assert visible(store) == sorted([before.name, folder.name]), "its tasks go when the artifact is there"


DAMAGES = [("params.json", x) for x in ("{", "[]", None)]
DAMAGES += [("numbers.txt", x) for x in ("1", "1 2 4", None)] + [("deep/more.txt", None)]


@pytest.mark.parametrize(("name", "content"), DAMAGES)
def test_a_damaged_artifact_is_reported_and_rebuilt(store, caplog, name, content):
    path = store.produce(numbers()) / name
    path.write_text(content) if content else path.unlink()
    with refused(ArtifactError, name):
        store.require(numbers())
    assert store.find(numbers()) is None
    assert caplog.text.count("it will be made again") == 1
    assert (store.produce(numbers()) / "numbers.txt").read_text() == "1 2 3"


def test_a_missing_artifact_is_compared_with_the_nearest_one(store):
    (store.produce(numbers(40)) / "params.json").unlink()
    (store.produce(numbers(50)) / "numbers.txt").unlink()
    with refused(ArtifactError, "numbers/kuka", "stage numbers") as alone:
        store.require(numbers(4200))
    assert "settings.count" not in str(alone.value)
    store.produce(numbers(400))
    store.produce(numbers(500, seed=7))
    of_missing = replace(numbers(), inputs={"numbers": numbers(4200)})
    for made in (numbers(4200), of_missing):
        with refused(ArtifactError, "settings.count", "400", "4200"):
            store.require(made)


def raise_disk_full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_an_unusable_output_folder_is_refused(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    with refused(StorageError, str(tmp_path / "file")):
        Store(tmp_path / "file")
    monkeypatch.setattr(os, "fsync", raise_disk_full)
    with refused(StorageError, os.strerror(errno.ENOSPC)):
        Store(tmp_path / "full")
    assert list((tmp_path / "full").iterdir()) == []


def test_a_full_disk_leaves_no_artifact(store, monkeypatch):
    (store.root / "numbers").write_text("in the way")
    with refused(StorageError, str(store.root / "numbers")):
        store.produce(numbers())
    (store.root / "numbers").unlink()
    monkeypatch.setattr(os, "fsync", raise_disk_full)
    with refused(StorageError, os.strerror(errno.ENOSPC)):
        store.produce(numbers())
    assert store.find(numbers()) is None


@pytest.fixture
def beside(store):
    """A process that holds an artifact until it is told to go on, and how to tell it."""
    context = multiprocessing.get_context("fork")
    started, go_on = context.Event(), context.Event()

    def make(build):
        started.set()
        go_on.wait(PATIENCE)
        write(build)

    process = context.Process(target=store.produce, args=(numbers(make=make),))
    process.start()
    assert started.wait(PATIENCE)
    yield process, go_on
    process.join()


def test_of_two_concurrent_runs_one_builds_and_one_waits(store, beside, monkeypatch):
    said = []

    def note(text, *values):
        said.append(text)
        if "waiting for it" in text:
            beside[1].set()

    monkeypatch.setattr(stores._log, "info", note)
    folder = store.produce(numbers(make=refuse))
    assert (folder / "numbers.txt").read_text() == "1 2 3" and "another run is making" in said[0]


def test_a_killed_run_does_not_block_others(store, beside):
    os.kill(beside[0].pid, signal.SIGKILL)
    beside[0].join()
    assert store.find(numbers()) is None
    folder = store.produce(numbers())
    assert visible(store) == [folder.name] and not list(store.root.glob("numbers/.*.tmp"))


def test_costs_are_stored_beside_the_artifact(store):
    def slow(build):
        write(build)
        build.costs["cpu_seconds"] = 3.0

    folder = store.produce(numbers(make=slow))
    assert {path.name for path in folder.iterdir()} == {"numbers.txt", "deep", "params.json"}
    assert store.costs(numbers())["cpu_seconds"] == 3.0 and store.costs(numbers(4)) == {}


def run(store, *artifacts, tracker):
    context = SimpleNamespace(store=store, planning=False, cfg=None)
    make_all(artifacts, context, tracker)


def test_artifacts_of_two_stages_are_recorded_once_costs_separately(store, monkeypatch):
    monkeypatch.setattr("sidegan.pipeline.run.MODELS", {"numbers"})
    tracker, metrics = Mock(recorded=set()), {"condition": 2.0, "loss": [3.0, None, 1.0]}
    artifact = replace(numbers(), title="gan/eigen", metrics=lambda folder: metrics, alone=True)
    for _ in range(2):
        run(store, artifact, tracker=tracker)
    found, took = (call.args[0] for call in tracker.log_metrics.call_args_list)
    assert found == {"gan/eigen/condition": 2.0}
    assert set(took) == {"seconds/gan eigen", "cpu_seconds/gan eigen"}
    model = tracker.log_model.return_value
    tracker.log_history.assert_called_once_with({"gan/eigen/loss": [3.0, None, 1.0]}, model)
    tracker.log_model.assert_called_once_with("gan/eigen", artifact.digest, store.folder(artifact))


def test_of_a_training_the_last_numbers_that_there_are_are_told(store, caplog):
    caplog.set_level("INFO")
    metrics = {"valid": [0.1, 0.0], "condition_valid": [9.0, None]}
    artifact = replace(numbers(), metrics=lambda folder: metrics, alone=True)
    run(store, artifact, tracker=Mock(recorded=set()))
    assert "after 2 epochs: valid 0" in caplog.text and "condition_valid" not in caplog.text


def test_what_a_run_made_before_it_fails_is_listed(store):
    def fail(build):
        raise KeyboardInterrupt

    first = replace(numbers(), alone=True)
    second = replace(numbers(4, fail), title="more", inputs={"numbers": first}, alone=True)
    with pytest.raises(KeyboardInterrupt):
        run(store, first, second, tracker=Mock(recorded=set()))
    listed = json.loads((store.run_folder / ARTIFACTS).read_text(encoding="utf-8"))
    assert listed == {"numbers": first.folder.as_posix()}


def test_artifacts_are_made_after_their_inputs(store):
    made = []

    def noted(name, **inputs):
        return replace(
            numbers(make=lambda _: made.append(name)), label=name, title=name, inputs=inputs, alone=True
        )

    seeds = noted("seeds", other=noted("elsewhere"))
    gan = noted("gan", seeds=seeds)
    run(store, noted("library", gan=gan, seeds=seeds), gan, seeds, seeds, tracker=Mock(recorded=set()))
    assert made == ["seeds", "gan", "library"]
