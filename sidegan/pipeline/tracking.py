"""What a run reports to MLflow; the only door to it.

Tracking never stops a run: when the server cannot be reached, one warning is given and whatever could not
be sent is kept, a JSON object a line, in ``untracked.jsonl`` in the run's folder. ``sidegan.untracked`` sends
it later.
"""

import json
import logging
import os
import re
import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self, TypeVar

from filelock import FileLock

from sidegan.pipeline.graph import flatten

if TYPE_CHECKING:
    import pandas as pd
    from mlflow import MlflowClient

log = logging.getLogger(__name__)

T = TypeVar("T")
Status = Literal["FINISHED", "FAILED", "KILLED"]

UNTRACKED = "untracked.jsonl"

_METRICS_AT_ONCE, _PARAMETERS_AT_ONCE, _PARAMETER_LENGTH = 1000, 100, 6000  # what MLflow takes
_ENVIRONMENT = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",  # the defaults wait for minutes when a server is gone
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
}


class Origin(NamedTuple):
    """Where a run comes from.

    Attributes:
        parent: run that it is a part of.
        run_id: run to go on with, instead of starting one.
        began: when the run that is started began [s since 1970]; None is now.
    """

    parent: str | None = None
    run_id: str | None = None
    began: float | None = None


_NEW = Origin()


class Tracker:
    """One MLflow run; as a context manager it ends with the status that the block's end deserves.

    Args:
        root: folder of all results; holds ``mlflow.db`` and its files by default.
        folder: of this run; takes what could not be sent.
        experiment: MLflow experiment.
        name: of the run, for people.
        uri: tracking server or database; None is sqlite in ``root``.
        enabled: False: nothing is recorded and MLflow is not imported.
        origin: what it is a part of, or goes on with.
    """

    def __init__(
        self,
        root: Path,
        folder: Path,
        experiment: str,
        name: str,
        uri: str | None = None,
        enabled: bool = True,
        origin: Origin = _NEW,
    ) -> None:
        self.root, self.folder, self.enabled = root, folder, enabled
        self.run_id, self._began = origin.run_id, origin.began
        self._client: MlflowClient | None = None
        self._reached = enabled
        tags = {} if origin.parent is None else {"mlflow.parentRunId": origin.parent}
        record = {"experiment": experiment, "name": name, "tags": tags}
        self._send("run", record, lambda: self._start(uri, experiment, name, tags))

    def log_params(self, values: Mapping[str, Any]) -> None:
        """Record settings; nested ones get dotted keys."""
        params = {_key(k): str(v)[:_PARAMETER_LENGTH] for k, v in flatten(values).items()}

        def send() -> None:
            from mlflow.entities import Param

            client, run = self._run
            for part in _parts([Param(k, v) for k, v in params.items()], _PARAMETERS_AT_ONCE):
                client.log_batch(run, params=part)

        self._send("params", params, send)

    def log_metrics(self, values: Mapping[str, float], step: int = 0) -> None:
        """Record one number each."""
        self.log_history({key: [value] for key, value in values.items()}, [step])

    def log_history(self, history: Mapping[str, Sequence[float]], steps: Sequence[int] | None = None) -> None:
        """Record a series of numbers each, all in one go.

        Args:
            history: name of each metric and its values.
            steps: of the values; 0, 1, … when not given.
        """
        now = round(1000 * time.time())
        rows = [
            (_key(name), float(value), now, step)
            for name, values in history.items()
            for step, value in zip(steps or range(len(values)), values)
        ]
        self.log_rows(rows)

    def log_rows(self, rows: Sequence[tuple[str, float, int, int]]) -> None:
        """Record numbers, each with its name, value, time [ms since 1970] and step."""

        def send() -> None:
            from mlflow.entities import Metric

            client, run = self._run
            for part in _parts([Metric(*row) for row in rows], _METRICS_AT_ONCE):
                client.log_batch(run, metrics=part)

        self._send("metrics", rows, send)

    def log_artifact(self, path: Path, folder: str | None = None) -> None:
        """Record a file, or all files of a folder, below ``folder`` of the run."""

        def send() -> None:
            client, run = self._run
            upload = client.log_artifacts if path.is_dir() else client.log_artifact
            upload(run, str(path), folder)

        self._send("artifact", {"path": str(path.absolute()), "folder": folder}, send)

    def log_table(self, table: "pd.DataFrame", name: str) -> None:
        """Record a table that MLflow shows beside the run; a named index becomes columns."""
        flat = table.reset_index() if any(table.index.names) else table

        def send() -> None:
            client, run = self._run
            client.log_table(run, flat, f"{name}.json")

        record = {"name": name, "table": json.loads(flat.to_json(orient="split", index=False))}
        self._send("table", record, send)

    def finish(self, status: Status, ended: float | None = None) -> None:
        """Close the run, which ended at a time [s since 1970]; None is now."""

        def send() -> None:
            client, run = self._run
            client.set_terminated(run, status, None if ended is None else round(1000 * ended))

        self._send("status", status, send)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.finish("FINISHED")
        else:
            self.finish("FAILED" if issubclass(kind, Exception) else "KILLED")

    @property
    def _run(self) -> "tuple[MlflowClient, str]":
        if self._client is None or self.run_id is None:
            raise ConnectionError("the run was not started")
        return self._client, self.run_id

    def _start(self, uri: str | None, experiment: str, name: str, tags: dict[str, str]) -> None:
        for key, value in _ENVIRONMENT.items():
            os.environ.setdefault(key, value)
        from mlflow import MlflowClient

        for noisy in ("mlflow", "alembic", "urllib3"):
            logging.getLogger(noisy).setLevel(logging.ERROR)
        root = self.root.resolve()
        # A server knows where its files go; a database would put them into the current folder.
        remote = uri is not None and uri.startswith(("http", "databricks"))
        # Two runs that start together must not both create the tables.
        with nullcontext() if remote else _one_at_a_time(root):
            database = root / "mlflow.db"
            with nullcontext() if uri or database.exists() else _made_at_once(database):
                client = MlflowClient(uri or f"sqlite:///{database}")
            if self.run_id is not None:
                client.get_run(self.run_id)  # raises when it is not there
            else:
                location = None if remote else (root / "mlartifacts" / experiment).as_uri()
                found = client.get_experiment_by_name(experiment)
                number = found.experiment_id if found else client.create_experiment(experiment, location)
                began = None if self._began is None else round(1000 * self._began)
                run = client.create_run(number, run_name=name, tags=tags, start_time=began)
                self.run_id = run.info.run_id
        self._client = client

    @property
    def reached(self) -> bool:
        """Whether everything could be sent so far."""
        return self._reached

    def _send(self, kind: str, content: Any, send: Callable[[], None]) -> None:
        if self._reached:
            try:
                send()
                return
            except Exception as error:  # whatever goes wrong at the other end, the work goes on
                self._reached = False
                reason = str(error).split("\n", 1)[0] or type(error).__name__
                log.warning("tracking stops (%s); the rest goes to %s", reason, self.folder / UNTRACKED)
        if self.enabled:
            line = json.dumps({"time": time.time(), "run": self.run_id, "kind": kind, "content": content})
            with suppress(OSError), (self.folder / UNTRACKED).open("a", encoding="utf-8") as file:
                file.write(f"{line}\n")


@contextmanager
def _one_at_a_time(root: Path) -> Iterator[None]:
    folder = root / ".locks"
    folder.mkdir(parents=True, exist_ok=True)
    with FileLock(folder / "mlflow.lock"):
        yield


@contextmanager
def _made_at_once(database: Path) -> Iterator[None]:
    """What the block makes of an SQLite database reaches the disk at its end.

    MLflow makes a new one by repeating all changes of its history, and would wait for the disk after each.
    """
    from sqlalchemy import event
    from sqlalchemy.engine import Engine

    opened: list[Any] = []

    def hurry(connection: Any, record: Any) -> None:
        opened.append(connection)
        connection.execute("PRAGMA synchronous = OFF")

    event.listen(Engine, "connect", hurry)
    try:
        yield
    finally:
        event.remove(Engine, "connect", hurry)
        for connection in opened:
            with suppress(sqlite3.Error):  # closed meanwhile
                connection.execute("PRAGMA synchronous = FULL")
    with database.open("rb") as file:
        os.fsync(file.fileno())


def _key(name: str) -> str:
    return re.sub(r"[^\w\-. :/]", "_", name)


def _parts(items: Sequence[T], size: int) -> Iterator[list[T]]:
    rest = iter(items)
    while part := list(islice(rest, size)):
        yield part
