"""Atomic writing of files, and readers that run no code from them."""

import hashlib
import io
import json
import math
import os
import platform
import shutil
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sidegan.errors import ArtifactError, ConfigError, ShapeError, SideganError, StorageError

if TYPE_CHECKING:  # slow to import, as NumPy is, and `--help` must not wait for them
    import pandas as pd
    import pyarrow as pa

    from sidegan.base.arrays import Array


def path_of(given: object, name: str) -> Path:
    """A path that a user gives as text or a path; a ConfigError that names it for anything else."""
    if not isinstance(given, str | os.PathLike):
        raise ConfigError(f"{name} is {given!r}, expected text or a path")
    return Path(given)


@contextmanager
def replacing(path: Path, folder: bool = True) -> Iterator[Path]:
    """Path of a temporary file that replaces ``path`` when the block succeeds.

    Content is synced to disk before the file is renamed. After any failure, including an interrupt, the
    temporary file is removed and ``path`` is unchanged. ``folder``: whether to create a missing folder.
    """
    if not path.name:  # as of "."
        raise StorageError(f"cannot write {path}: it is a folder")
    neighbour = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.tmp")
    try:
        with writing(path):
            if folder:
                path.parent.mkdir(parents=True, exist_ok=True)
            yield neighbour
            _sync(neighbour)
            neighbour.replace(path)
            with suppress(OSError):  # some network file systems cannot sync a folder
                _sync(path.parent)
    finally:
        with suppress(OSError):
            neighbour.unlink()


@contextmanager
def replacing_folder(path: Path, ours: Callable[[Path], bool]) -> Iterator[Path]:
    """Path of a temporary folder that replaces ``path`` when the block succeeds.

    Existing contents that are not ``ours`` are kept. After a failure ``path`` is unchanged.
    """
    new, old = path.with_name(f".{path.name}.new"), path.with_name(f".{path.name}.old")
    with writing(path):
        if old.exists() and not path.exists():  # a run was killed between the two renames below
            old.rename(path)
        for left in (new, old):
            shutil.rmtree(left, ignore_errors=True)
        new.mkdir(parents=True)
    try:
        yield new
        with writing(path):
            if path.exists():
                for entry in path.iterdir():
                    if entry.is_dir():
                        shutil.copytree(entry, new / entry.name)
                    elif not ours(entry):
                        shutil.copy2(entry, new / entry.name)
                path.rename(old)
            new.rename(path)
    finally:
        shutil.rmtree(new, ignore_errors=True)
    shutil.rmtree(old, ignore_errors=True)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn the system's errors on writing into a StorageError that names the path."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror or error}") from error


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_bytes(path: Path, content: bytes | memoryview, folder: bool = True) -> None:
    """Write bytes; see ``replacing``."""
    with replacing(path, folder) as neighbour:
        neighbour.write_bytes(content)


def write_json(path: Path, content: Any) -> None:
    """Write plain values as standard JSON; ShapeError for a number that is not finite."""
    try:
        text = json.dumps(content, indent=2, allow_nan=False)
    except ValueError as error:
        raise ShapeError(f"cannot write {path} as JSON: {error}") from error
    write_bytes(path, f"{text}\n".encode())


def write_mlmodel(folder: Path, **loading: str) -> None:
    """Write the file MLmodel, by which ``mlflow.pyfunc.load_model`` loads what is in a folder.

    ``loading``: MLflow's settings of a Python function, such as ``loader_module`` and ``data``.
    """
    import yaml

    function = {**loading, "python_version": platform.python_version()}
    write_bytes(folder / "MLmodel", yaml.safe_dump({"flavors": {"python_function": function}}).encode())


def finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with None instead of values that are not finite, for JSON."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}


def write_arrays(path: Path, arrays: "Mapping[str, Array]", folder: bool = True) -> None:
    """Write named arrays as ``.npz``; see ``replacing``."""
    import numpy as np

    buffer = io.BytesIO()  # in memory first, since a plain write reports a full disk properly
    np.savez(buffer, **arrays)  # type: ignore[arg-type]  # of its own argument allow_pickle
    write_bytes(path, buffer.getbuffer(), folder)


def write_parquet(path: Path, table: "pa.Table", **options: Any) -> None:
    """Write a table with page checksums, to detect damage; see ``replacing``."""
    import pyarrow.parquet as pq

    with replacing(path) as neighbour:
        pq.write_table(table, neighbour, write_page_checksum=True, **options)


def read_json(path: Path) -> Any:
    """Plain values of a JSON file; ArtifactError if it is missing, truncated, or not JSON."""
    with reading(path, "JSON"):
        return json.loads(path.read_bytes())


def read_arrays(path: Path) -> "dict[str, Array]":
    """Named arrays of an ``.npz`` file without objects; ArtifactError for anything else."""
    import numpy as np

    with reading(path, "NumPy"), np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
        return dict(file)


def write_frame(path: Path, frame: "pd.DataFrame") -> None:
    """Write a frame without its index as Parquet; see ``write_parquet``."""
    import pyarrow as pa

    write_parquet(path, pa.Table.from_pandas(frame, preserve_index=False))


def readable(path: Path, read: Callable[[Path], Any] = read_arrays) -> bool:
    """Whether a file, of arrays by default, is complete, so that a resumed run can reuse it."""
    try:
        read(path)
    except ArtifactError:
        return False
    return True


def read_parquet(path: Path) -> Iterator["pa.Table"]:
    """Tables of a Parquet file's row groups, or an empty one if there are none.

    Page checksums are verified; ArtifactError if the file is damaged.
    """
    import pyarrow.parquet as pq

    with reading(path, "Parquet"), pq.ParquetFile(path, page_checksum_verification=True) as file:
        if not file.num_row_groups:
            yield file.schema_arrow.empty_table()
        for k in range(file.num_row_groups):
            yield file.read_row_group(k)


def parquet_rows(path: Path) -> int:
    """Number of rows of a Parquet file, without reading them; ArtifactError if it is damaged."""
    import pyarrow.parquet as pq

    with reading(path, "Parquet"):
        return pq.read_metadata(path).num_rows


@contextmanager
def reading(path: Path, kind: str, refusal: type[SideganError] = ArtifactError) -> Iterator[None]:
    """Turn readers' errors on a missing or invalid file into our error, with the reason.

    Anything but files and folders is refused before it is read: a pipe or a device may never end.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise refusal(f"{path} is neither a file nor a folder")
        yield
    except SideganError:  # raised by the reader itself
        raise
    except FileNotFoundError as error:
        raise refusal(f"there is no file {path}") from error
    except Exception as error:  # readers raise anything for an invalid file, such as KeyError
        if isinstance(error, OSError) and error.errno is not None:
            raise StorageError(f"cannot read {path}: {error.strerror or error}") from error
        reason = str(error).split("\n", 1)[0] or type(error).__name__
        raise refusal(f"{path} is not a complete {kind} file: {reason}") from error


def file_digest(path: Path) -> str:
    """Hexadecimal SHA-256 of a file, cached until the file changes."""
    status = path.stat()
    return _digest(path, status.st_size, status.st_mtime_ns, status.st_ino)


@lru_cache(4096)
def _digest(path: Path, size: int, changed: int, inode: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
