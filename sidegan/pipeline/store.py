"""Artifacts on disk: folders that appear only when complete, record their origin, and are reused.

<root>/<maker>/<label>-<digest>/            files of the artifact and params.json
<root>/<maker>/<label>-<digest>.work/       task files of an unfinished artifact; survive a kill
<root>/costs/<maker>/<label>-<digest>.json  computing time
<root>/.locks/                              a lock per artifact, released by the system with the process
"""

import logging
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from filelock import FileLock, Timeout

from sidegan.base.parallel import Report, cpu_seconds
from sidegan.base.progress import duration
from sidegan.base.settings_text import command_messages
from sidegan.base.storage import file_digest, read_json, write_json, writing
from sidegan.base.threads import one_thread
from sidegan.errors import ArtifactError, StorageError
from sidegan.pipeline.artifact import Artifact, Build, difference, stages_of
from sidegan.pipeline.tracking import Curves

_log = logging.getLogger(__name__)

PARAMS = "params.json"
_PROBE = bytes(2**20)  # is written once, to see that there is room


class Store:
    """Artifacts below a root folder, which is created if missing; and the folder for this run's tables.

    Raises:
        StorageError: when the root cannot be written, or is full.
    """

    def __init__(self, root: Path, run_folder: Path | None = None) -> None:
        self.root = root
        self.run_folder = run_folder or root
        self.curves: Curves | None = None  # where trainings log while they run
        self._damaged = set[Path]()  # reported, each once
        try:
            root.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=root) as probe:  # unnamed, so that a kill leaves nothing
                probe.write(_PROBE)
                probe.flush()
                os.fsync(probe.fileno())
        except OSError as error:
            reason = error.strerror or error
            raise StorageError(f"the output folder {root} cannot be used: {reason}") from error

    def folder(self, artifact: Artifact) -> Path:
        """Folder of the artifact, whether it exists or not."""
        return self.root / artifact.folder

    def find(self, artifact: Artifact) -> Path | None:
        """Folder of the artifact, or None when it is absent, damaged, or made from something else."""
        folder = self.folder(artifact)
        if not folder.exists():
            return None
        try:
            return folder if read_params(folder) == artifact.params else None
        except ArtifactError as error:
            if folder not in self._damaged:
                _log.warning("%s: it will be made again", error)
            self._damaged.add(folder)
            return None

    def require(self, artifact: Artifact) -> Path:
        """Folder of an existing artifact; otherwise an ArtifactError says how the nearest one differs.

        If an input is missing too, the error is about that.
        """
        if (folder := self.find(artifact)) is not None:
            return folder
        for source in artifact.inputs.values():
            if isinstance(source, Artifact):
                self.require(source)
        if (folder := self.folder(artifact)).exists():
            read_params(folder)  # raises if it is damaged
        name, stages = f"{artifact.maker}/{artifact.label}", " or ".join(stages_of(artifact.maker))
        message = f"there is no {name} for this configuration, run stage {stages} first"
        differences = []
        for path in sorted(folder.parent.glob(f"*/{PARAMS}")):
            with suppress(ArtifactError):  # skip damaged ones
                other = read_params(path.parent)
                if other.get("label") == artifact.label:
                    differences.append(difference(artifact.params, other))
        if differences:
            message += f"; in the nearest one, {', '.join(min(differences, key=len)[:4])}"
        raise ArtifactError(message)

    def costs(self, artifact: Artifact) -> dict[str, Any]:
        """Costs of making an artifact: ``seconds``, ``cpu_seconds``, and others; empty if not stored."""
        path = self.root / "costs" / f"{artifact.folder}.json"
        return read_json(path) if path.exists() else {}

    @command_messages()  # as in the process that a worker works for
    def produce(self, artifact: Artifact, report: Report = lambda done, total: None) -> Path:
        """Folder of the artifact, made unless it exists; waits for another run that is making it."""
        final = self.folder(artifact)
        work = final.with_name(f"{final.name}.work")
        with self._lock(artifact):
            if self.find(artifact) is None:
                self._make(artifact, Build(final.with_name(f".{final.name}.tmp"), work, report))
            else:
                _log.info("%s: reused from %s", artifact.maker, final)
            shutil.rmtree(work, ignore_errors=True)
        return final

    def _make(self, artifact: Artifact, build: Build) -> None:
        final = self.folder(artifact)
        folder = build.folder
        shutil.rmtree(folder, ignore_errors=True)  # left by a killed run: this run holds the lock
        began = time.monotonic()
        used = cpu_seconds()
        try:
            with writing(final):
                folder.mkdir(parents=True)
                build.work.mkdir(exist_ok=True)
            with one_thread():  # as in a worker, so that results do not depend on the process
                artifact.make(build)
            seconds = time.monotonic() - began
            files = sorted(path for path in folder.rglob("*") if path.is_file())
            digests = {path.relative_to(folder).as_posix(): file_digest(path) for path in files}
            write_json(folder / PARAMS, {**artifact.params, "files": digests})
            times = {"seconds": round(seconds, 1), "cpu_seconds": round(cpu_seconds() - used, 1)}
            write_json(self.root / "costs" / f"{artifact.folder}.json", times | build.costs)
            with writing(final):
                if final.exists():  # damaged; a folder cannot be renamed over another
                    shutil.rmtree(final)
                folder.rename(final)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        _log.info("%s: made %s in %s", artifact.maker, final, duration(seconds))

    @contextmanager
    def _lock(self, artifact: Artifact) -> Iterator[None]:
        path = self.root / ".locks" / f"{'-'.join(artifact.folder.parts)}.lock"
        with writing(path):
            path.parent.mkdir(exist_ok=True)
            lock = FileLock(path)
            try:
                lock.acquire(timeout=0)
            except Timeout:
                folder = self.folder(artifact)
                _log.info("%s: another run is making %s, waiting for it", artifact.maker, folder)
                lock.acquire()
        try:
            yield
        finally:
            lock.release()


def read_params(folder: Path) -> dict[str, Any]:
    """Parameters of an artifact; an ArtifactError if a file is missing or has changed."""
    params = read_json(folder / PARAMS)
    if not isinstance(params, dict) or not isinstance(files := params.pop("files", None), dict):
        raise ArtifactError(f"{folder / PARAMS} has no parameters of an artifact")
    for name, digest in files.items():
        path = folder / name
        if not path.is_file():
            raise ArtifactError(f"{path} is missing")
        if file_digest(path) != digest:
            raise ArtifactError(f"{path} is damaged: it differs from the file that was written")
    return params
