"""What a run reports to MLflow; the only door to it.

Tracking never stops a run: when the server cannot be reached, one warning is given and whatever could not
be sent is kept, a JSON object a line, in ``untracked.jsonl`` in the run's folder. ``sidegan.untracked`` sends
it later. Nor does it keep a short run waiting: MLflow takes seconds to import, so what the first seconds
report is kept in the same way, and a process of its own sends it when the run has ended by then.
"""

import json
import logging
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self

from filelock import FileLock, Timeout

from sidegan.pipeline.database import made_at_once
from sidegan.pipeline.graph import flatten

if TYPE_CHECKING:
    import pandas as pd
    from mlflow import MlflowClient

log = logging.getLogger(__name__)

Status = Literal["FINISHED", "FAILED", "KILLED"]

UNTRACKED = "untracked.jsonl"
SENDING = "untracked.sending.jsonl"  # the same while it is being sent

_RUN, _RUN_ID = "run-{}.lock", re.compile("run-(.+)[.]lock")

_METRICS_AT_ONCE, _PARAMETERS_AT_ONCE, _PARAMETER_LENGTH = 1000, 100, 6000  # what MLflow takes
_NOTE, _NOTE_LENGTH = "mlflow.note.content", 8000  # the description of a run, in Markdown
_ENVIRONMENT = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",  # the defaults wait for minutes when a server is gone
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
}


class Tracker:
    """One MLflow run; as a context manager it ends with the status that the block's end deserves.

    Args:
        root: folder of all results; holds ``mlflow.db`` and its files by default.
        folder: of this run; takes what could not be sent.
        experiment: MLflow experiment.
        name: of the run, for people.
        uri: tracking server or database; None is sqlite in ``root``.
        enabled: False: nothing is recorded and MLflow is not imported.
        parent: run that it is a part of.
        patience: how long a run has to take before MLflow is imported in its process [s].
    """

    def __init__(
        self,
        root: Path,
        folder: Path,
        experiment: str,
        name: str,
        uri: str | None = None,
        enabled: bool = True,
        parent: str | None = None,
        patience: float = 0.0,
    ) -> None:
        self.root, self.folder, self.uri = root.resolve(), folder, uri
        self.enabled = self.reached = enabled  # whether everything could be sent so far
        self.kept = True  # whether everything else could be written
        self.told: set[str] = set()  # digests of the artifacts whose numbers are recorded
        self.notes = ""
        self.run_id: str | None = None
        self._client: MlflowClient | None = None
        self._alive: FileLock | None = None  # held while the run goes on, whatever ends it
        self._waiting: list[tuple[str, Any, float]] | None = [] if enabled and patience > 0 else None
        self._until = time.monotonic() + patience
        tags = {} if parent is None else {"mlflow.parentRunId": parent}
        self.send("run", {"experiment": experiment, "name": name, "tags": tags})

    @classmethod
    def resumed(cls, root: Path, folder: Path, uri: str | None, run_id: str | None) -> Self:
        """Goes on with a run, or with the one whose record is sent first; keeps nothing itself."""
        tracker = cls(root, folder, "", "", uri, enabled=False)
        tracker.reached, tracker.run_id = True, run_id
        return tracker

    def log_params(self, values: Mapping[str, Any]) -> None:
        """Record settings; nested ones get dotted keys."""
        self.send("params", {_key(k): str(v)[:_PARAMETER_LENGTH] for k, v in flatten(values).items()})

    def log_metrics(self, values: Mapping[str, float]) -> None:
        """Record one number each."""
        self.log_history({key: [value] for key, value in values.items()})

    def log_history(self, history: Mapping[str, Sequence[float]], steps: Sequence[int] | None = None) -> None:
        """Record a series of numbers each, all in one go.

        Args:
            history: name of each metric and its values.
            steps: of the values; 0, 1, … when not given.
        """
        now = _milliseconds(time.time())
        rows = [
            (_key(name), float(value), now, step)
            for name, values in history.items()
            for step, value in zip(steps or range(len(values)), values)
        ]
        self.send("metrics", rows)

    def log_artifact(self, path: Path, folder: str | None = None) -> None:
        """Record a file, or all files of a folder, below ``folder`` of the run."""
        self.send("artifact", {"path": str(path.absolute()), "folder": folder})

    def log_table(self, table: "pd.DataFrame", name: str) -> None:
        """Record a table that MLflow shows beside the run; a named index becomes columns."""
        flat = table.reset_index() if any(table.index.names) else table
        self.send("table", {"name": name, "table": json.loads(flat.to_json(orient="split", index=False))})

    def log_note(self, text: str) -> None:
        """Add Markdown to the description that MLflow shows first, unless there is no room left for it."""
        notes = f"{self.notes}{text.strip()}\n\n"
        if len(notes) <= _NOTE_LENGTH:
            self.notes = notes
            self.send("note", notes)

    def finish(self, status: Status) -> None:
        """Close the run."""
        self.send("status", status)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.finish("FINISHED")
        else:
            self.finish("FAILED" if issubclass(kind, Exception) else "KILLED")

    def send(self, kind: str, content: Any, at: float | None = None) -> None:
        """Record plain values of a time [s since 1970], None is now; what cannot be sent is kept."""
        if self._waiting is not None:
            self._wait(self._waiting, kind, content)
            return
        if self.reached:
            try:
                self._record(kind, content, at)
                return
            except Exception as error:  # whatever goes wrong at the other end, the work goes on
                self.reached = False
                log.warning(
                    "tracking stops (%s); the rest goes to %s", _reason(error), self.folder / UNTRACKED
                )
        if self.enabled:
            self._keep(kind, content, at or time.time())

    def _wait(self, waiting: list[tuple[str, Any, float]], kind: str, content: Any) -> None:
        """Keep a record until the run has ended, or taken so long that MLflow's import no longer counts."""
        waiting.append((kind, content, time.time()))
        self._keep(*waiting[-1])
        ended = kind == "status"
        if not self.kept or (not ended and time.monotonic() > self._until):
            self._catch_up(waiting)
        elif ended:
            self._hand_over(waiting)

    def _catch_up(self, waiting: list[tuple[str, Any, float]]) -> None:
        """Send what was kept, and from now on everything as it comes."""
        self._waiting = None
        kept, sending = self.folder / UNTRACKED, self.folder / SENDING
        with suppress(OSError):
            kept.replace(sending)
        for record in waiting:
            self.send(*record)
        with suppress(OSError):
            sending.unlink()

    def _hand_over(self, waiting: list[tuple[str, Any, float]]) -> None:
        """Have what was kept sent by a process that outlives this one, and Ctrl-C."""
        command = [sys.executable, "-m", "sidegan.untracked", str(self.root), "--only", str(self.folder)]
        command += ["--uri", self.uri] if self.uri else []
        none = subprocess.DEVNULL
        try:
            subprocess.Popen(command, stdin=none, stdout=none, stderr=none, start_new_session=True)
        except OSError:
            self._catch_up(waiting)
            return
        log.info("MLflow gets what is in %s now, in the background", self.folder / UNTRACKED)

    def _keep(self, kind: str, content: Any, at: float) -> None:
        """Keep a record as a line for later; where that cannot be done either, say so once."""
        record = {"time": at, "run": self.run_id, "kind": kind, "content": content}
        try:
            with (self.folder / UNTRACKED).open("a", encoding="utf-8") as file:
                file.write(f"{json.dumps(record)}\n")
        except OSError as error:
            if self.kept:
                path = self.folder / UNTRACKED
                log.warning("%s cannot be written (%s): it is not whole", path, error.strerror)
            self.kept = False

    def _record(self, kind: str, content: Any, at: float | None) -> None:
        client = self._client = self._client or self._connected()
        from mlflow.entities import Metric, Param

        if self.run_id is None:
            if kind != "run":
                raise ConnectionError("the run was not started")
            self._mark_killed(client)
            self.run_id = self._started(client, at, **content)
            if self.enabled:
                self._alive = FileLock(self._locks / _RUN.format(self.run_id))
                self._alive.acquire(timeout=0)
        run = self.run_id
        match kind:
            case "params":
                params = [Param(*item) for item in content.items()]
                for i in range(0, len(params), _PARAMETERS_AT_ONCE):
                    client.log_batch(run, params=params[i : i + _PARAMETERS_AT_ONCE])
            case "metrics":
                metrics = [Metric(*row) for row in content]
                for i in range(0, len(metrics), _METRICS_AT_ONCE):
                    client.log_batch(run, metrics=metrics[i : i + _METRICS_AT_ONCE])
            case "artifact":
                _upload(client, run, **content)
            case "table":
                import pandas as pd

                client.log_table(run, pd.DataFrame(**content["table"]), f"{content['name']}.json")
            case "note":
                client.set_tag(run, _NOTE, content)
            case "status":
                client.set_terminated(run, content, _milliseconds(at))
                self._leave()

    def _mark_killed(self, client: "MlflowClient") -> None:
        """Mark runs whose process is gone without a word: nobody holds their locks any more."""
        from mlflow.exceptions import MlflowException

        for path in self._locks.glob(_RUN.format("*")):
            lock = FileLock(path)
            with suppress(Timeout, OSError, MlflowException), lock.acquire(timeout=0):
                run = _RUN_ID.fullmatch(path.name)
                if run and client.get_run(run[1]).info.status == "RUNNING":
                    client.set_terminated(run[1], "KILLED")
                path.unlink(missing_ok=True)

    def _leave(self) -> None:
        """Give the run's lock back."""
        if self._alive is not None:
            self._alive.release()
            Path(self._alive.lock_file).unlink(missing_ok=True)
            self._alive = None

    @property
    def _locks(self) -> Path:
        folder = self.root / ".locks"
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def _connected(self) -> "MlflowClient":
        for key, value in _ENVIRONMENT.items():
            os.environ.setdefault(key, value)
        from mlflow import MlflowClient

        for noisy in ("alembic", "urllib3"):
            logging.getLogger(noisy).setLevel(logging.ERROR)
        # What goes wrong is raised as well, and told in one line; MLflow would print tracebacks before.
        logging.getLogger("mlflow").setLevel(logging.CRITICAL)
        database = self.root / "mlflow.db"
        with (
            self._one_at_a_time(),
            nullcontext() if self.uri or database.exists() else made_at_once(database),
        ):
            return MlflowClient(self.uri or f"sqlite:///{database}")

    def _started(
        self, client: "MlflowClient", at: float | None, experiment: str, name: str, tags: dict[str, str]
    ) -> str:
        # A server knows where its files go; a database would put them into the current folder.
        location = None if self._remote else (self.root / "mlartifacts" / experiment).as_uri()
        with self._one_at_a_time():
            found = client.get_experiment_by_name(experiment)
            number = found.experiment_id if found else client.create_experiment(experiment, location)
        run = client.create_run(number, run_name=name, tags=tags, start_time=_milliseconds(at))
        return run.info.run_id

    @property
    def _remote(self) -> bool:
        return self.uri is not None and self.uri.startswith(("http", "databricks"))

    @contextmanager
    def _one_at_a_time(self) -> Iterator[None]:
        """Two runs that start together must not both create the tables of a database, or the experiment."""
        if self._remote:
            yield
            return
        with FileLock(self._locks / "mlflow.lock"):
            yield


def _upload(client: "MlflowClient", run: str, path: str, folder: str | None) -> None:
    """Send a file, or all files of a folder."""
    if Path(path).is_dir():
        client.log_artifacts(run, path, folder)
    elif Path(path).exists():
        client.log_artifact(run, path, folder)
    else:
        log.warning("%s is gone and cannot be sent", path)


def _reason(error: BaseException) -> str:
    """What went wrong in the first place, in one line; those who passed it on have more words for it."""
    while error.__cause__ is not None:
        error = error.__cause__
    return str(error).split("\n", 1)[0] or type(error).__name__


def _key(name: str) -> str:
    return re.sub(r"[^\w\-. :/]", "_", name)


def _milliseconds(time_of_day: float | None) -> int | None:
    return None if time_of_day is None else round(1000 * time_of_day)
