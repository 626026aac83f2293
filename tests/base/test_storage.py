import errno
import json
import os
import resource
import stat
from contextlib import contextmanager

import pyarrow as pa
import pytest
import torch

from sidegan.base.storage import (
    read_json,
    read_parquet,
    read_torch,
    replacing,
    write_bytes,
    write_json,
    write_parquet,
    write_torch,
)
from sidegan.errors import ArtifactError, ShapeError, StorageError

TABLE = pa.table({"x": list(range(5000)), "name": ["a", "b"] * 2500})
STATE = {"weight": torch.arange(5000.0), "epoch": 3, "names": ["a"]}
WRITERS = {
    "bytes": lambda path: write_bytes(path, b"new" * 5000),
    "json": lambda path: write_json(path, list(range(5000))),
    "torch": lambda path: write_torch(path, STATE),
    "parquet": lambda path: write_parquet(path, TABLE, compression="none"),
}
READERS = {"json": read_json, "torch": read_torch, "parquet": read_parquet}


@pytest.fixture(params=WRITERS)
def kind(request):
    return request.param


@contextmanager
def small_files_only():
    """Only around the write itself: the test runner writes files too."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_what_is_written_is_read(tmp_path):
    write_json(tmp_path / "a.json", {"x": [1, 0.1, None, "ü"]})
    write_torch(tmp_path / "a.pt", STATE)
    write_parquet(tmp_path / "a.parquet", TABLE)
    write_bytes(tmp_path / "a", b"\x00\xff")
    assert read_json(tmp_path / "a.json") == {"x": [1, 0.1, None, "ü"]}
    state = read_torch(tmp_path / "a.pt")
    assert torch.equal(state["weight"], STATE["weight"]) and state["names"] == ["a"]
    assert read_parquet(tmp_path / "a.parquet").equals(TABLE)
    assert (tmp_path / "a").read_bytes() == b"\x00\xff"


def test_a_write_makes_the_folder_replaces_the_file_and_leaves_nothing_else(tmp_path, kind):
    path = tmp_path / "deep" / "er" / "file"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"old")
    WRITERS[kind](path)
    assert path.read_bytes() != b"old"
    assert list(path.parent.iterdir()) == [path]
    WRITERS[kind](tmp_path / "new" / "folder" / "file")
    assert (tmp_path / "new" / "folder" / "file").exists()


def test_a_file_has_the_permissions_of_any_other_new_file(tmp_path):
    (tmp_path / "plain").write_bytes(b"")
    write_bytes(tmp_path / "file", b"x")
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == stat.S_IMODE(
        (tmp_path / "plain").stat().st_mode
    )


def test_a_write_that_does_not_fit_leaves_the_old_file(tmp_path, kind):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    with pytest.raises(StorageError, match=rf"cannot write {path}: .*too large"), small_files_only():
        WRITERS[kind](path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES, errno.EROFS, errno.EDQUOT])
@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_refusal_of_the_system_names_path_and_reason(tmp_path, monkeypatch, number, call):
    def refuse(*_args):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, refuse)
    with pytest.raises(StorageError, match=rf"cannot write {tmp_path / 'file'}: {os.strerror(number)}"):
        write_bytes(tmp_path / "file", b"x")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_a_file_and_a_file_that_is_a_folder(tmp_path, kind):
    (tmp_path / "file").write_bytes(b"old")
    (tmp_path / "folder").mkdir()
    with pytest.raises(StorageError, match="file"):
        WRITERS[kind](tmp_path / "file" / "below")
    with pytest.raises(StorageError, match="folder"):
        WRITERS[kind](tmp_path / "folder")
    assert sorted(x.name for x in tmp_path.iterdir()) == ["file", "folder"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_interrupt_passes_and_leaves_the_old_file(tmp_path, error):
    path = tmp_path / "file"
    path.write_bytes(b"old")

    def interrupted() -> None:
        with replacing(path) as neighbour:
            neighbour.write_bytes(b"half")
            raise error

    with pytest.raises(error):
        interrupted()
    assert list(tmp_path.iterdir()) == [path] and path.read_bytes() == b"old"


def test_content_is_on_the_disk_before_the_name_changes(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(os, "fsync", lambda _fd: calls.append((tmp_path / "file").exists()))
    write_bytes(tmp_path / "file", b"x")
    assert calls == [False, True]  # the file, then the folder that names it


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_json_refuses_what_other_readers_cannot_read(tmp_path, value):
    with pytest.raises(ShapeError, match=r"file\.json"):
        write_json(tmp_path / "file.json", {"x": value})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("damage", ["missing", "empty", "truncated", "foreign"])
def test_a_damaged_file_is_refused(tmp_path, kind, damage):
    path = tmp_path / "file"
    WRITERS[kind](path)
    content = path.read_bytes()
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(
            {"empty": b"", "truncated": content[: len(content) // 2], "foreign": b"hello" * 99}[damage]
        )
    with pytest.raises(ArtifactError, match=str(path)):
        READERS[kind](path)


@pytest.mark.parametrize("kind", READERS)
def test_a_folder_in_place_of_a_file_is_refused(tmp_path, kind):
    with pytest.raises((StorageError, ArtifactError), match=str(tmp_path)):
        READERS[kind](tmp_path)


def test_a_flipped_byte_inside_a_parquet_file_is_noticed(tmp_path):
    path = tmp_path / "file"
    write_parquet(path, TABLE, compression="none", use_dictionary=False)
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 1
    path.write_bytes(content)
    with pytest.raises(ArtifactError, match="Parquet"):
        read_parquet(path)


class Harmful:
    def __reduce__(self):
        return (os.mkdir, ("harmed",))


def test_reading_tensors_runs_no_code(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    torch.save({"x": Harmful()}, tmp_path / "file.pt")
    with pytest.raises(ArtifactError, match="tensor"):
        read_torch(tmp_path / "file.pt")
    assert not (tmp_path / "harmed").exists()


def test_json_is_plain_text_with_a_last_line_end(tmp_path):
    write_json(tmp_path / "file", {"b": 1, "a": 2})
    text = (tmp_path / "file").read_text()
    assert text.endswith("}\n") and json.loads(text) == {"b": 1, "a": 2}
