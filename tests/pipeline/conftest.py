"""Tasks at a small size, the command within this process, and a tracking database for all tests."""

import shutil
import signal
import sys

import pytest
from filelock import FileLock

from sidegan.pipeline.artifact import Build
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.store import Store
from sidegan.pipeline.tracking import _database as make_database
from sidegan.run import main
from tests.tiny import tiny

NOWHERE = "http://127.0.0.1:9"  # the discard port: nothing listens there


@pytest.fixture(autouse=True)
def messages(of_the_command):
    """Messages are those of the command."""


@pytest.fixture
def context(tmp_path):
    """Tiny tasks with changed settings, whose outputs are the test's own."""

    def made(*overrides, **options):
        return RunContext(tiny(f"outputs={tmp_path}", *overrides, **options), Store(tmp_path))

    return made


@pytest.fixture
def build(tmp_path):
    """Where one artifact can be made without a store."""
    folder = tmp_path / "made"
    folder.mkdir()
    return Build(folder, tmp_path / "made.work", lambda done, total: None)


@pytest.fixture
def command(tmp_path, monkeypatch):
    """The command within this process, in a folder of its own: arguments → exit code."""
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    monkeypatch.chdir(tmp_path)
    handling = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}

    def call(*arguments, tracking="off"):
        chosen = [] if any("experiment=" in word for word in arguments) else ["+experiment=exp1"]
        flags = [word for word in arguments if word.startswith("-")]
        settings = [word for word in arguments if not word.startswith("-")]
        monkeypatch.setattr(sys, "argv", ["sidegan", *flags, *chosen, *settings, f"tracking={tracking}"])
        try:
            return main()
        except SystemExit as leave:
            return leave.code

    yield call
    for number, handler in handling.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session")
def database(outputs):
    """An empty database of MLflow, which takes seconds to make: one for all processes."""
    folder = outputs.parent / "database"
    folder.mkdir(exist_ok=True)
    with FileLock(folder / "lock"):
        make_database(folder)
    return folder / "mlflow.db"


@pytest.fixture(scope="session")
def root(database, tmp_path_factory):
    """Outputs in which tests record."""
    folder = tmp_path_factory.mktemp("outputs")
    shutil.copy(database, folder)
    return folder


def client_of(root):
    from mlflow import MlflowClient

    return MlflowClient(f"sqlite:///{root / 'mlflow.db'}")
