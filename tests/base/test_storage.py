"""Files are written whole or not at all, and what is read is whole or refused."""

import errno
import os
import resource
from contextlib import contextmanager

import numpy as np
import pyarrow as pa
import pytest

from sidegan.base import storage
from sidegan.base.storage import read_arrays, read_json, read_parquet, write_bytes, write_json
from sidegan.errors import ArtifactError, ShapeError, SideganError, StorageError
from tests.refusals import refused

TABLE = pa.table({"x": list(range(5000)), "name": ["a", "b"] * 2500})
STATE = {"weight": np.arange(5000.0), "names": np.array(["a", "ü"])}
WRITERS = {
    "bytes": lambda path: write_bytes(path, b"new" * 5000),
    "json": lambda path: write_json(path, list(range(5000))),
    "arrays": lambda path: storage.write_arrays(path, STATE),
    "parquet": lambda path: storage.write_parquet(path, TABLE, compression="none"),
}
READERS = {
    "json": read_json,
    "arrays": read_arrays,
    "parquet": lambda path: pa.concat_tables(read_parquet(path)),
}


@pytest.fixture
def path(tmp_path):
    """A file that is there already."""
    (tmp_path / "file").write_bytes(b"old")
    return tmp_path / "file"


@contextmanager
def small_files_only():
    """Only around the write itself: the test runner writes files too."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_written_files_read_back(path):
    for content in ({"x": [1, 0.1, None, "ü"]}, []):
        write_json(path, content)
        assert read_json(path) == content
    WRITERS["arrays"](path)
    state = read_arrays(path)
    assert state.keys() == STATE.keys() and all(np.array_equal(state[key], STATE[key]) for key in STATE)
    WRITERS["parquet"](path)
    assert READERS["parquet"](path).equals(TABLE)
    assert storage.parquet_rows(path) == len(TABLE)
    write_bytes(path, b"\x00\xff")
    assert path.read_bytes() == b"\x00\xff"


@pytest.mark.parametrize("kind", WRITERS)
def test_a_write_is_atomic(path, kind):
    with refused(StorageError, str(path)), small_files_only():
        WRITERS[kind](path)
    assert path.read_bytes() == b"old"
    WRITERS[kind](path)
    assert path.read_bytes() != b"old"
    assert list(path.parent.iterdir()) == [path]
    WRITERS[kind](path.parent / "new" / "folder" / "file")
    assert (path.parent / "new" / "folder" / "file").exists()
    with refused(StorageError, str(path / "below")):
        WRITERS[kind](path / "below")
    with refused(StorageError, "folder"):
        WRITERS[kind](path.parent / "new" / "folder")
    assert sorted(x.name for x in path.parent.iterdir()) == ["file", "new"]


def test_json_refuses_non_standard_values(path):
    with refused(ShapeError, str(path)):
        write_json(path, {"x": float("nan")})
    assert path.read_bytes() == b"old"


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_system_error_names_path_and_reason(path, monkeypatch, call):
    monkeypatch.setattr(os, call, full)
    with refused(StorageError, str(path), os.strerror(errno.ENOSPC)):
        write_bytes(path, b"x")
    assert list(path.parent.iterdir()) == [path] and path.read_bytes() == b"old"


def test_an_interrupted_write_leaves_the_old_file(path):
    with pytest.raises(KeyboardInterrupt), storage.replacing(path) as neighbour:
        neighbour.write_bytes(b"half")
        raise KeyboardInterrupt
    assert list(path.parent.iterdir()) == [path] and path.read_bytes() == b"old"


def test_content_is_synced_before_the_rename(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(os, "fsync", lambda _fd: calls.append((tmp_path / "file").exists()))
    write_bytes(tmp_path / "file", b"x")
    assert calls == [False, True]  # the file, then the folder that names it


DAMAGES = (lambda content: b"", lambda content: content[: len(content) // 2], lambda content: b"hello" * 99)


@pytest.mark.parametrize("kind", READERS)
def test_missing_and_damaged_files_are_refused(path, kind):
    WRITERS[kind](path)
    content = path.read_bytes()
    for damage in DAMAGES:
        path.write_bytes(damage(content))
        with refused(ArtifactError, str(path)):
            READERS[kind](path)
    path.unlink()
    with refused(ArtifactError, str(path)):
        READERS[kind](path)
    with refused(SideganError, str(path.parent)):  # a folder
        READERS[kind](path.parent)


class Harmful:
    def __reduce__(self):
        return (os.mkdir, ("harmed",))


def test_reading_arrays_executes_no_pickled_code(path, monkeypatch):
    monkeypatch.chdir(path.parent)
    with path.open("wb") as file:
        np.savez(file, x=np.array(Harmful()))
    with refused(ArtifactError, str(path)):
        read_arrays(path)
    assert list(path.parent.iterdir()) == [path]


def test_a_folder_is_replaced_atomically_and_foreign_files_stay(tmp_path):
    folder = tmp_path / "set"

    def written(*names, fail=False):
        with storage.replacing_folder(folder, lambda path: path.stem.isdigit()) as new:
            for name in names:
                (new / name).write_text("new")
            if fail:
                raise KeyboardInterrupt
        return {path.name for path in folder.iterdir()}

    assert written("1", "2") == {"1", "2"}
    (folder / "log").mkdir()
    (folder / "log" / "a").write_text("mine")
    with pytest.raises(KeyboardInterrupt):
        written("3", fail=True)
    assert {path.name for path in folder.iterdir()} == {"1", "2", "log"}
    assert written("3") == {"3", "log"} and (folder / "log" / "a").read_text() == "mine"
    folder.rename(tmp_path / ".set.old")  # where a kill between two renames leaves it
    assert written("4") == {"4", "log"} and [path.name for path in tmp_path.iterdir()] == ["set"]
