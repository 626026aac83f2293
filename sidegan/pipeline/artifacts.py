"""Results on disk: folders that appear whole, carry a stamp of what they came from, and are reused.

<root>/<stage>/<label>-<stamp>/        files of the artifact and stamp.json
<root>/<stage>/<label>-<stamp>.work/   task files of an unfinished build; survive a kill
<root>/.locks/                         one lock per artifact, released by the system with the process
"""

import dataclasses
import logging
import os
import shutil
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from filelock import FileLock, Timeout

import sidegan
from sidegan.base.progress import duration
from sidegan.base.storage import read_json, write_json
from sidegan.errors import ArtifactError, StorageError
from sidegan.pipeline.stamp import Stamp, folder_name

log = logging.getLogger(__name__)

Make = Callable[[Path, Path], None]

_STAMP = "stamp.json"
_PROBE = bytes(2**20)  # room that a run needs at the very least


class Store:
    """The artifacts below a root folder.

    Args:
        root: folder of all results; made when missing.
        named: folders without a stamp in their name; then one artifact replaces another.
        run_folder: where this run's logs and tables go; the root when not given.

    Raises:
        StorageError: when the root cannot be written, or is full.
    """

    def __init__(self, root: Path, named: bool = False, run_folder: Path | None = None) -> None:
        self.root, self.named = root, named
        self.run_folder = run_folder or root
        try:
            root.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=root) as probe:  # has no name, so a kill leaves nothing
                probe.write(_PROBE)
                probe.flush()
                os.fsync(probe.fileno())
        except OSError as error:
            reason = error.strerror or error
            raise StorageError(f"the output folder {root} cannot be used: {reason}") from error

    def stamp(
        self,
        stage: str,
        label: str,
        config: Any,
        inputs: Mapping[str, str] | None = None,
        code: Iterable[str] = (),
        seed: int | None = None,
    ) -> Stamp:
        """Stamp of an artifact.

        Args:
            stage: who makes it.
            label: what tells it from its siblings at a glance.
            config: a dataclass of the settings it depends on, or a mapping of values and dataclasses.
            inputs: digest of each thing it is made from (``Stamp.digest``, ``Arm.digest``).
            code: rooms whose source makes it, e.g. ``"seeds"``, ``"dynamics"``.
            seed: of its random numbers.
        """
        if dataclasses.is_dataclass(config) and not isinstance(config, type):
            config = dataclasses.asdict(config)
        digests: dict[str, str] = {}
        return Stamp(stage, folder_name(label), dict(config), dict(inputs or {}), digests, seed)

    def folder(self, stamp: Stamp) -> Path:
        """Where the artifact is or will be."""
        name = stamp.label if self.named else f"{stamp.label}-{stamp.digest[:8]}"
        return self.root / stamp.stage / name

    def find(self, stamp: Stamp) -> Path | None:
        """Folder of the artifact, or None when it is absent, damaged, or made from something else."""
        folder = self.folder(stamp)
        if not folder.exists():
            return None
        try:
            different = stamp.difference(_read(folder))
        except ArtifactError as error:
            log.warning("%s: it will be made anew", error)
            return None
        if different:
            log.info("%s does not match: %s", folder, "; ".join(different))
        return None if different else folder

    def require(self, stamp: Stamp) -> Path:
        """Folder of an artifact that must be there.

        Raises:
            ArtifactError: when it is not, saying in what the nearest one differs.
        """
        found = self.find(stamp)
        if found is not None:
            return found
        folder = self.folder(stamp)
        if folder.exists():
            _read(folder)  # raises, and says why, when it is damaged
        message = (
            f"there is no {stamp.stage}/{stamp.label} for this configuration, run stage {stamp.stage} first"
        )
        differences = [stamp.difference(other) for other in self._siblings(stamp)]
        if differences:
            message += f"; of the nearest one {', '.join(min(differences, key=len)[:4])}"
        raise ArtifactError(message)

    def produce(self, stamp: Stamp, make: Make) -> Path:
        """Folder of the artifact, made by ``make(folder, work)`` unless it is there already.

        ``folder`` takes the files of the artifact and is invisible until ``make`` returns. ``work`` takes the
        files of tasks: it survives an interrupt, and is there again when the same artifact is made
        anew. Of two runs that want the same artifact, one makes it and the other waits.

        Raises:
            StorageError: when something cannot be written.
        """
        with self._lock(stamp):
            found = self.find(stamp)
            if found is not None:
                log.info("%s: reused from %s", stamp.stage, found)
                return found
            return self._make(stamp, make)

    def _make(self, stamp: Stamp, make: Make) -> Path:
        final = self.folder(stamp)
        work = final.with_name(f"{stamp.label}-{stamp.digest[:8]}.work")
        for leftover in final.parent.glob(f".{final.name}.*.tmp"):  # of a killed run; the lock is ours
            shutil.rmtree(leftover, ignore_errors=True)
        folder = final.with_name(f".{final.name}.{uuid.uuid4().hex[:8]}.tmp")
        began = time.monotonic()
        try:
            with _storage_errors(final):
                folder.mkdir(parents=True)
                work.mkdir(exist_ok=True)
            make(folder, work)
            seconds = time.monotonic() - began
            extra = {"version": sidegan.__version__, "seconds": round(seconds, 1), "files": _sizes(folder)}
            write_json(folder / _STAMP, {**stamp.plain(), **extra})
            with _storage_errors(final):
                _replace(folder, final)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        shutil.rmtree(work, ignore_errors=True)
        log.info("%s: made %s in %s", stamp.stage, final, duration(seconds))
        return final

    @contextmanager
    def _lock(self, stamp: Stamp) -> Iterator[None]:
        path = self.root / ".locks" / f"{stamp.stage}-{self.folder(stamp).name}.lock"
        with _storage_errors(path):
            path.parent.mkdir(exist_ok=True)
            lock = FileLock(path)
            try:
                lock.acquire(timeout=0)
            except Timeout:
                log.info("%s: another run is making %s, waiting for it", stamp.stage, self.folder(stamp))
                lock.acquire()
        try:
            yield
        finally:
            lock.release()

    def _siblings(self, stamp: Stamp) -> Iterator[dict[str, Any]]:
        for path in sorted((self.root / stamp.stage).glob(f"*/{_STAMP}")):
            try:
                other = _read(path.parent)
            except ArtifactError:
                continue
            if other.get("label") == stamp.label:
                yield other


def _read(folder: Path) -> dict[str, Any]:
    """Plain stamp of a whole artifact."""
    stamp = read_json(folder / _STAMP)
    if not isinstance(stamp, dict) or not isinstance(stamp.get("files"), dict):
        raise ArtifactError(f"{folder / _STAMP} is not a stamp")
    sizes = _sizes(folder)
    for name, size in stamp["files"].items():
        if sizes.get(name) != size:
            raise ArtifactError(f"{folder / name} has {sizes.get(name, 0)} bytes, expected {size}")
    return {f.name: stamp.get(f.name) for f in dataclasses.fields(Stamp)}


def _sizes(folder: Path) -> dict[str, int]:
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / _STAMP)
    return {path.relative_to(folder).as_posix(): path.stat().st_size for path in files}


def _replace(folder: Path, final: Path) -> None:
    # A folder cannot be renamed over another; whoever looks in between sees none.
    old = final.with_name(f".{final.name}.old.tmp")
    shutil.rmtree(old, ignore_errors=True)
    if final.exists():
        final.rename(old)
    folder.rename(final)
    shutil.rmtree(old, ignore_errors=True)


@contextmanager
def _storage_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror or error}") from error
