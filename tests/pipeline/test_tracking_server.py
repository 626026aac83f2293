"""MLflow on a server with a real PostgreSQL behind it, started by the tests and killed by one of them."""

import getpass
import os
import pwd
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path

import pytest

from sidegan.pipeline.tracking import UNTRACKED, Tracker
from sidegan.untracked import send_kept

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("initdb") is None, reason="PostgreSQL is not installed: no initdb"),
    pytest.mark.skipif(find_spec("psycopg2") is None, reason="pip install 'sidegan[postgres]'"),
]


def free_port():
    with closing(socket.socket()) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def wait_until(ready, process, seconds=60):
    end = time.monotonic() + seconds
    while not ready():
        assert process.poll() is None, "it ended by itself"
        assert time.monotonic() < end, "it never became ready"
        time.sleep(0.2)


@pytest.fixture(scope="module")
def database():
    """URI of an empty PostgreSQL."""
    user = getpass.getuser()
    if os.getuid() == 0:  # PostgreSQL refuses to run as root
        try:
            user = pwd.getpwnam("postgres").pw_name
        except KeyError:
            pytest.skip("root needs a user called postgres to run PostgreSQL as")
    folder = Path(tempfile.mkdtemp(prefix="sidegan-postgres-"))
    shutil.chown(folder, user)
    port = free_port()
    as_user = {"user": user if os.getuid() == 0 else None, "cwd": folder}
    initdb = ["initdb", "-D", "data", "-U", "mlflow", "-A", "trust", "--no-sync", "-E", "UTF8", "--no-locale"]
    subprocess.run(initdb, check=True, stdout=subprocess.DEVNULL, **as_user)
    options = ["-p", str(port), "-k", str(folder), "-h", "127.0.0.1", "-c", "fsync=off"]
    with (folder / "log").open("w") as log:
        server = subprocess.Popen(["postgres", "-D", "data", *options], stderr=log, **as_user)
    try:
        probe = ["pg_isready", "-q", "-h", "127.0.0.1", "-p", str(port)]
        wait_until(lambda: subprocess.run(probe, check=False).returncode == 0, server)
        yield f"postgresql+psycopg2://mlflow@127.0.0.1:{port}/postgres"
    finally:
        server.send_signal(signal.SIGINT)  # a fast shutdown, whoever is connected
        server.wait(30)
        shutil.rmtree(folder)


class Server:
    """An MLflow server on a database, which can be killed and started again."""

    def __init__(self, database, folder):
        self.port, self.database, self.folder = free_port(), database, folder
        self.uri = f"http://127.0.0.1:{self.port}"
        self.start()

    def start(self):
        command = [sys.executable, "-m", "mlflow", "server", "--workers", "1", "--port", str(self.port)]
        stores = ["--backend-store-uri", self.database, "--artifacts-destination", str(self.folder)]
        environment = {**os.environ, "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
        with (self.folder / "server.log").open("a") as log:
            self.process = subprocess.Popen(
                [*command, *stores], stdout=log, stderr=log, start_new_session=True, env=environment
            )
        wait_until(self.answers, self.process)

    def answers(self):
        try:
            with urllib.request.urlopen(f"{self.uri}/health", timeout=1) as answer:
                return answer.status == 200
        except OSError:
            return False

    def kill(self):
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


@pytest.fixture(scope="module")
def server(database, tmp_path_factory):
    """An MLflow server."""
    one = Server(database, tmp_path_factory.mktemp("objects"))
    yield one
    one.kill()


def rows(database, query):
    import psycopg2

    with (
        closing(psycopg2.connect(database.replace("+psycopg2", ""))) as connection,
        connection.cursor() as cursor,
    ):
        cursor.execute(query)
        return cursor.fetchall()


def test_a_run_is_in_the_database_and_its_files_in_the_store(server, database, tmp_path):
    (tmp_path / "table.csv").write_text("a,b")
    with Tracker(tmp_path, tmp_path, "exp1", "remote", server.uri) as tracker:
        tracker.log_params({"seed": 1})
        tracker.log_history({"loss": [3.0, 2.0]})
        tracker.log_artifact(tmp_path / "table.csv")
    assert rows(database, f"select status from runs where run_uuid = '{tracker.run_id}'") == [("FINISHED",)]
    found = rows(database, f"select key, value, step from metrics where run_uuid = '{tracker.run_id}'")
    assert sorted(found) == [("loss", 2.0, 1), ("loss", 3.0, 0)]
    (stored,) = server.folder.rglob("table.csv")
    assert stored.read_text() == "a,b" and tracker.run_id in stored.parts
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"], "nothing is recorded here"


def test_runs_may_write_into_the_database_themselves(server, database, tmp_path):
    with Tracker(tmp_path, tmp_path, "direct", "by itself", database) as tracker:
        tracker.log_metrics({"nmse": 0.5})
    found = rows(database, f"select key, value from metrics where run_uuid = '{tracker.run_id}'")
    assert found == [("nmse", 0.5)]
    (location,) = rows(database, "select artifact_location from experiments where name = 'direct'")
    assert location[0].startswith(tmp_path.as_uri())


def test_a_server_killed_in_the_middle_gets_the_rest_later(server, database, tmp_path, caplog):
    with Tracker(tmp_path, tmp_path, "exp1", "interrupted", server.uri) as tracker:
        tracker.log_metrics({"before": 1.0})
        server.kill()
        began = time.monotonic()
        tracker.log_metrics({"after": 2.0})
        tracker.log_params({"seed": 1})
    assert time.monotonic() - began < 20, "a run must not wait long for a server that is gone"
    assert caplog.text.count("tracking stops") == 1
    assert (tmp_path / UNTRACKED).exists()
    server.start()
    assert send_kept(tmp_path, tmp_path, server.uri)
    query = f"select key, value from metrics where run_uuid = '{tracker.run_id}' order by key"
    assert rows(database, query) == [("after", 2.0), ("before", 1.0)]
    assert rows(database, f"select status from runs where run_uuid = '{tracker.run_id}'") == [("FINISHED",)]
