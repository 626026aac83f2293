import errno
import logging
import multiprocessing
import os
import shutil
import signal
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import pytest
import torch
from threadpoolctl import threadpool_info

from sidegan.base.storage import write_task
from sidegan.errors import ArtifactError, StorageError
from sidegan.pipeline import graph
from sidegan.pipeline import store as stores
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage, run_stage
from sidegan.pipeline.store import Store
from tests.threads import several_threads

PATIENCE = 120  # [s] with processes that others keep from their work


@pytest.fixture(autouse=True)
def versions(monkeypatch):
    """A maker of numbers."""
    monkeypatch.setattr(graph, "versions", lambda: {"numbers": 1})


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "outputs")


def write(build):
    (build.folder / "numbers.txt").write_text("1 2 3")


def refuse(build):
    raise AssertionError("must not be made again")


def numbers(count=3, make=write, seed=0, inputs=None):
    return Artifact(
        "numbers", "kuka", "numbers", {"count": count}, inputs or {}, seed, make, lambda folder: {}
    )


def visible(store):
    return sorted(p.relative_to(store.root).as_posix() for p in store.root.glob("numbers/[!.]*"))


def test_an_artifact_is_made_once_and_found_again(store):
    artifact = numbers()
    assert store.find(artifact) is None
    folder = store.produce(artifact)
    assert (folder / "numbers.txt").read_text() == "1 2 3"
    assert Store(store.root).find(numbers()) == folder
    assert store.produce(replace(artifact, make=refuse)) == folder == store.require(artifact)


def test_artifacts_of_other_settings_and_inputs_lie_side_by_side(store):
    made = [numbers(count, seed=seed) for count in (3, 4) for seed in (0, 1)]
    made += [numbers(inputs={"seeds": digest}) for digest in (made[0].digest, "another")]
    folders = {store.produce(one) for one in made}
    assert len(folders) == 6 and all(folder.name.startswith("kuka-") for folder in folders)


def test_what_is_damaged_is_no_neighbour(store):
    for count, name in ((400, "stamp.json"), (500, "numbers.txt")):
        damaged(store.produce(numbers(count)), name, None)
    with pytest.raises(ArtifactError, match=r"run stage numbers first$"):
        store.require(numbers(4200))


def test_an_artifact_is_made_on_one_thread_as_a_worker_makes_it(store):
    def make(build):
        most = max([torch.get_num_threads(), *(pool["num_threads"] for pool in threadpool_info())])
        (build.folder / "numbers.txt").write_text(str(most))

    with several_threads():
        folder = store.produce(numbers(make=make))
        assert torch.get_num_threads() == 2
    assert (folder / "numbers.txt").read_text() == "1"


def test_an_artifact_is_invisible_until_it_is_whole(store):
    artifact = numbers()

    def make(build):
        write(build)
        assert store.find(artifact) is None
        assert not store.folder(artifact).exists()

    store.produce(replace(artifact, make=make))


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_stopped_build_leaves_its_tasks_and_nothing_else(store, error):
    artifact = numbers()

    def stopped(build):
        write(build)
        (build.work / "task-0.txt").write_text("done")
        raise error

    with pytest.raises(error):
        store.produce(replace(artifact, make=stopped))
    assert store.find(artifact) is None
    assert visible(store) == [f"numbers/{store.folder(artifact).name}.work"]

    def goes_on(build):
        assert (build.work / "task-0.txt").read_text() == "done"
        write(build)

    folder = store.produce(replace(artifact, make=goes_on))
    assert visible(store) == [f"numbers/{folder.name}"], "task files go when the artifact is there"


@pytest.mark.parametrize("left", ["{}.work", ".{}.tmp", ".{}.work.tmp", ".{}.old.tmp"])
def test_what_a_run_left_that_was_killed_behind_its_artifact_is_cleared_away_by_the_next_one(store, left):
    artifact = numbers()
    folder = store.produce(artifact)
    leftover = folder.with_name(left.format(folder.name))
    leftover.mkdir()
    (leftover / "task-0.txt").write_text("done")
    assert store.produce(replace(artifact, make=refuse)) == folder
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def test_a_task_that_was_given_up_cannot_bring_the_folder_of_work_back(store):
    late = []

    def make(build):
        write(build)
        write_task(build.work / "task-0.pt", {"a": 1})
        late.append(partial(write_task, build.work / "task-1.pt", {"a": 2}))

    folder = store.produce(numbers(make=make))
    with pytest.raises(StorageError, match=r"cannot write .*task-1\.pt: No such file"):
        late[0]()
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


DAMAGES = {
    "stamp.json": ["{", "[]", None],
    "numbers.txt": ["1", "1 2 4", None],
}


def damaged(folder, name, content):
    """The folder with a file that says something else, or that is gone."""
    (folder / name).write_text(content) if content else (folder / name).unlink()
    return folder


@pytest.mark.parametrize(("name", "content"), [(name, one) for name, some in DAMAGES.items() for one in some])
def test_a_damaged_artifact_is_told_when_asked_for_and_made_anew(store, caplog, name, content):
    damaged(store.produce(numbers()), name, content)
    with pytest.raises(ArtifactError, match=r"stamp\.json|numbers\.txt"):
        store.require(numbers())
    assert store.find(numbers()) is None
    assert "it will be made anew" in caplog.text
    assert (store.produce(numbers()) / "numbers.txt").read_text() == "1 2 3"


def test_a_missing_artifact_is_refused_with_the_difference_to_the_nearest(store):
    with pytest.raises(
        ArtifactError, match=r"no numbers/kuka for this configuration, run stage numbers first$"
    ):
        store.require(numbers())
    store.produce(numbers(400, write))
    store.produce(numbers(500, write, seed=7))
    with pytest.raises(ArtifactError, match=r"of the nearest one settings\.count is 400, not 4200$"):
        store.require(numbers(4200))


def test_a_failed_build_leaves_what_was_there_before(store):
    store.produce(numbers(3, write))
    with pytest.raises(AssertionError):
        store.produce(numbers(4, refuse))
    assert store.find(numbers(3)) is not None and store.find(numbers(4)) is None


def test_an_output_folder_that_cannot_be_written_is_refused_at_once(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match=r"output folder .*file"):
        Store(tmp_path / "file")


def test_a_full_disk_is_refused_at_once(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match="No space left"):
        Store(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_later_leaves_no_artifact(store, monkeypatch):
    def full(path, content):
        raise StorageError("no space left")

    monkeypatch.setattr(stores, "write_json", full)
    with pytest.raises(StorageError):
        store.produce(numbers(3, write))
    assert store.find(numbers()) is None


def test_a_stage_folder_that_cannot_be_made_is_a_storage_error(store):
    (store.root / "numbers").write_text("in the way")
    with pytest.raises(StorageError, match="numbers"):
        store.produce(numbers(3, write))


def test_an_empty_folder_of_files_in_folders_is_stamped_too(store):
    def nested(build):
        (build.folder / "deep").mkdir()
        (build.folder / "deep" / "numbers.txt").write_text("1 2 3")

    folder = store.produce(numbers(3, nested))
    shutil.rmtree(folder / "deep")
    with pytest.raises(ArtifactError, match=r"deep/numbers\.txt is missing"):
        store.require(numbers())


def _slow(root, started, go_on, made):
    def make(build):
        with made.get_lock():
            made.value += 1
        started.set()
        go_on.wait(PATIENCE)
        write(build)

    store = Store(root)
    store.produce(numbers(make=make))


@pytest.fixture
def processes():
    """Two processes that want the same artifact; the first holds it until told to go on."""
    context = multiprocessing.get_context("fork")
    return context, context.Event(), context.Event(), context.Value("i", 0)


def test_of_two_runs_at_once_one_makes_and_the_other_waits_and_reuses(tmp_path, caplog, processes):
    caplog.set_level(logging.INFO)
    context, started, go_on, made = processes
    first = context.Process(target=_slow, args=(tmp_path, started, go_on, made))
    first.start()
    assert started.wait(PATIENCE)
    waiting = _Waiting(go_on)
    stores.log.addHandler(waiting)
    try:
        store = Store(tmp_path)
        folder = store.produce(numbers(3, refuse))
    finally:
        stores.log.removeHandler(waiting)
        first.join()
    assert "another run is making" in caplog.text
    assert made.value == 1 and (folder / "numbers.txt").read_text() == "1 2 3"


class _Waiting(logging.Handler):
    """Lets the first process go on as soon as the second says that it waits."""

    def __init__(self, go_on):
        super().__init__()
        self.go_on = go_on

    def emit(self, record):
        if "waiting" in record.getMessage():
            self.go_on.set()


def test_a_killed_run_holds_up_nobody(tmp_path, processes):
    context, started, go_on, made = processes
    first = context.Process(target=_slow, args=(tmp_path, started, go_on, made))
    first.start()
    assert started.wait(PATIENCE)
    os.kill(first.pid, signal.SIGKILL)
    first.join()
    store = Store(tmp_path)
    assert store.find(numbers()) is None
    store.produce(numbers(3, write))
    assert not list(tmp_path.glob("numbers/.*.tmp"))


def test_what_it_took_is_kept_beside_the_artifact_and_not_in_it(tmp_path):
    def slow(build):
        write(build)
        build.costs["cpu_seconds"] = 3.0

    quick, slowly = Store(tmp_path / "quick"), Store(tmp_path / "slowly")
    folders = quick.produce(numbers()), slowly.produce(numbers(make=slow))
    files = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders]
    assert files[0] == files[1]
    assert slowly.costs(numbers())["cpu_seconds"] == 3.0 and quick.costs(numbers())["seconds"] >= 0
    assert Store(tmp_path / "none").costs(numbers()) == {}


class _Recorded:
    """In place of a tracker: what it was given."""

    def __init__(self):
        self.told, self.metrics, self.series = set(), {}, []

    def log_metrics(self, values):
        assert not values.keys() & self.metrics.keys(), "recorded twice"
        self.metrics |= values

    def log_history(self, history, steps):
        self.series.append((history, steps))


def test_what_two_stages_list_is_recorded_once_and_what_it_took_stands_apart(tmp_path):
    def metrics(folder):
        return {"condition": 2.0, "loss": [3.0, None, 1.0]}

    one = replace(numbers(3, write), title="gan/eigen", metrics=metrics, alone=True)
    cfg = SimpleNamespace(has=lambda *_: False, parallel=SimpleNamespace(workers=1))
    task, tracker = SimpleNamespace(store=Store(tmp_path), cfg=cfg), _Recorded()
    for name in ("surrogates", "gan"):
        run_stage(name, Stage(lambda _: [one]), task, tracker)
    assert tracker.metrics["gan/eigen/condition"] == 2.0
    assert {"seconds/gan eigen", "cpu_seconds/gan eigen"} < tracker.metrics.keys()
    assert tracker.series == [({"gan/eigen/loss": [3.0, 1.0]}, [0, 2])]
