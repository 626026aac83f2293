"""Runs in MLflow. If the server fails, a run logs one warning and continues without it."""

import logging
import os
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from filelock import FileLock

from sidegan.base.extras import extra, installed
from sidegan.base.names import dotted

if TYPE_CHECKING:
    import pandas as pd
    from mlflow.utils.async_logging.run_operations import RunOperations
    from pytorch_lightning.loggers import MLFlowLogger

_log = logging.getLogger(__name__)

Status = Literal["FINISHED", "FAILED", "KILLED"]
_NOTE, _NOTE_LENGTH = "mlflow.note.content", 8000  # the description of a run, in Markdown
_PARENT = "mlflow.parentRunId"  # tag of a child run
_ENVIRONMENT = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",  # the defaults wait for minutes when a server is gone
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
}


def _guarded(method: Callable[..., Any]) -> Callable[..., Any]:
    """Guard a method that calls MLflow: the first failure of any logs a warning and disables all."""

    @wraps(method)
    def call(self: Any, *args: Any, **kwargs: Any) -> Any:
        if self.enabled:
            try:
                return method(self, *args, **kwargs)
            except Exception as error:  # no failure of tracking may stop the run
                self.enabled = False
                _log.warning("the run continues without MLflow: %s", _reason(error))
        return None

    return call


@dataclass(frozen=True)
class Curves:
    """Where trainings log while they run, in whichever process: child runs of an experiment's run."""

    server: str  # URI
    experiment: str
    parent: str  # ID of the experiment's run

    def logger(self, name: str) -> "MLFlowLogger":
        """Lightning's logger of a training; the first failure of MLflow warns and ends its records."""
        from pytorch_lightning.loggers import MLFlowLogger

        class Guarded(MLFlowLogger):
            enabled = True
            log_metrics = _guarded(MLFlowLogger.log_metrics)
            finalize = _guarded(MLFlowLogger.finalize)

        tags = {_PARENT: self.parent}
        return Guarded(self.experiment, run_name=name, tracking_uri=self.server, tags=tags)


class Tracker:
    """One MLflow run of an experiment; as a context manager it sets the run's final status.

    ``where``: ``local`` for ``mlflow.db`` in ``root``, the folder of all results; the URI of a server or
    database; ``off``, which records nothing and does not import MLflow, a slow import; or ``auto``, which is
    ``local`` where MLflow is installed and otherwise ``off``.
    """

    def __init__(
        self, root: Path, experiment: str, name: str, where: str = "local", parent: str | None = None
    ) -> None:
        if where == "auto":
            where = "local" if installed("mlflow") else "off"
        self.enabled = where != "off"
        self.run_id = ""  # MLflow's; empty if nothing is recorded
        self.curves: Curves | None = None  # for trainings; None if nothing is recorded
        self.recorded = set[str]()  # digests of recorded artifacts
        self._note = ""
        self._pending: list[RunOperations | None] = []
        self._start(root.resolve(), experiment, name, where, parent)

    @_guarded
    def _start(self, root: Path, experiment: str, name: str, where: str, parent: str | None) -> None:
        for key, value in _ENVIRONMENT.items():
            os.environ.setdefault(key, value)
        root.mkdir(parents=True, exist_ok=True)
        with extra("tracking"):
            from mlflow import MlflowClient

        logging.getLogger("alembic").setLevel(logging.ERROR)
        for noisy in ("mlflow", "urllib3"):  # they also raise what they log
            logging.getLogger(noisy).setLevel(logging.CRITICAL)
        # A server knows where its files go; with a database they would go into the current folder.
        remote = where.startswith(("http", "databricks"))
        files = None if remote else (root / "mlartifacts" / experiment).as_uri()
        with FileLock(root / ".mlflow.lock"):  # parallel runs must not create database or experiment twice
            server = _database(root) if where == "local" else where
            self._client = client = MlflowClient(server)
            found = client.get_experiment_by_name(experiment)
            self._experiment = found.experiment_id if found else client.create_experiment(experiment, files)
        tags = {} if parent is None else {_PARENT: parent}
        self.run_id = client.create_run(self._experiment, run_name=name, tags=tags).info.run_id
        self.curves = Curves(server, experiment, self.run_id)

    @_guarded
    def log_params(self, values: Mapping[str, Any]) -> None:
        """Record settings; nested ones get dotted keys."""
        from mlflow.entities import Param

        params = [Param(_key(key), str(x)) for key, x in dotted(values).items()]
        self._pending.append(self._client.log_batch(self.run_id, params=params, synchronous=False))

    def log_metrics(self, values: Mapping[str, float], model: str | None = None) -> None:
        """Record numbers, of a recorded model if given."""
        self.log_history({key: [value] for key, value in values.items()}, model)

    @_guarded
    def log_history(self, history: Mapping[str, Sequence[float | None]], model: str | None = None) -> None:
        """Record series of numbers at steps 0, 1, …; None is skipped."""
        from mlflow.entities import Metric

        now = round(1000 * time.time())
        rows = [(_key(name), x, step) for name, values in history.items() for step, x in enumerate(values)]
        metrics = [Metric(key, float(x), now, step, model) for key, x, step in rows if x is not None]
        self._pending.append(self._client.log_batch(self.run_id, metrics, synchronous=False))

    @_guarded
    def log_artifact(self, path: Path, folder: str | None = None) -> None:
        """Record a file, or all files of a folder, below ``folder`` of the run."""
        record = self._client.log_artifacts if path.is_dir() else self._client.log_artifact
        record(self.run_id, str(path), folder)

    @_guarded
    def log_table(self, table: "pd.DataFrame", name: str) -> None:
        """Record a table that MLflow shows with the run; a named index becomes columns."""
        flat = table.reset_index() if any(table.index.names) else table
        self._client.log_table(self.run_id, flat, f"{name}.json")

    @_guarded
    def log_note(self, text: str) -> None:
        """Append Markdown to the run's description, unless it would become too long."""
        note = f"{self._note}{text.strip()}\n\n"
        if len(note) <= _NOTE_LENGTH:
            self._note = note
            self._client.set_tag(self.run_id, _NOTE, note)

    @_guarded
    def log_model(self, name: str, digest: str, folder: Path) -> str | None:
        """Record a folder as a model, and return its ID; None if an earlier run has recorded it."""
        from mlflow.entities import LoggedModelOutput

        known = self._client.search_logged_models([self._experiment], f"tags.digest = '{digest}'")
        if known:
            model = known[0].model_id
        else:
            named = re.sub(r"[^\w-]", "-", name)
            tags = {"digest": digest}
            model = self._client.create_logged_model(self._experiment, named, self.run_id, tags).model_id
            self._client.log_model_artifacts(model, str(folder))
            self._client.finalize_logged_model(model, "READY")
        self._client.log_outputs(self.run_id, [LoggedModelOutput(model, step=0)])
        return None if known else model

    @_guarded
    def finish(self, status: Status) -> None:
        """Wait for pending records, and close the run."""
        try:
            for operations in filter(None, self._pending):
                operations.wait()
        finally:
            self._client.set_terminated(self.run_id, status)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        failed: Status = "FAILED" if kind and issubclass(kind, Exception) else "KILLED"
        self.finish("FINISHED" if kind is None else failed)


def _database(root: Path) -> str:
    """URI of the database in a folder, made if it is missing; an interrupt leaves no half of its tables."""
    from mlflow import MlflowClient

    final = root / "mlflow.db"
    if not final.exists():
        part = root / ".mlflow.db"
        part.unlink(missing_ok=True)
        MlflowClient(f"sqlite:///{part}")  # makes the tables
        part.replace(final)
    return f"sqlite:///{final}"


def _reason(error: BaseException) -> str:
    """Message of an error's root cause, in one line."""
    while error.__cause__ is not None:
        error = error.__cause__
    return str(error).split("\n", 1)[0] or type(error).__name__


def _key(name: str) -> str:
    return re.sub(r"[^\w\-. :/]", "_", name)
