"""The cache of compiled kernels on disk."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import sidegan

KERNEL = """
import logging, sys, time
from pathlib import Path
import numba
import numpy as np
from numba.core import event
before = numba.config.CACHE_DIR
from sidegan.kernels import caller
Path(sys.argv[1]).touch()
end = time.monotonic() + 60
while not Path("go").exists() and time.monotonic() < end:
    time.sleep(0.001)
words, compiled, x = [], [], np.zeros(1)
handler = logging.Handler()
handler.emit = lambda record: words.append("compiling for this processor, once" in record.getMessage())
logging.basicConfig(level="INFO", handlers=[handler])
with event.install_recorder("numba:compile") as recorder:
    caller.three_times(x, 2.0)
    names = [entry.data["dispatcher"].__name__ for _, entry in recorder.buffer if entry.is_start]
assert numba.config.CACHE_DIR == before  # that of other code stays where it is
print(x[0], names.count("three_times"), sum(words))
"""
CALLER = """
from sidegan.kernels import callee
from sidegan.kernels.jit import kernel

@kernel
def three_times(x, y):
    x[0] = callee.times(3.0, y)
"""
CALLEE = """
from sidegan.kernels.jit import inline

@inline
def times(s, y):
    return s * y
"""


def start(folder, name="any"):
    """A process that imports the kernels, waits for the file ``go`` and calls one."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["SIDEGAN_CACHE"] = str(folder / "cache")
    command = [sys.executable, "-c", KERNEL, name]
    return subprocess.Popen(command, env=environment, cwd=folder, stdout=subprocess.PIPE, text=True)


def answer(process):
    """Result of the kernel, how often it was compiled, and how often that was logged."""
    text = process.communicate(timeout=6000)[0].strip()
    assert process.returncode == 0
    return text


@pytest.fixture
def folder(tmp_path):
    """Folder with a copy of what the cache needs of the package, and two kernels in two files."""
    source = Path(sidegan.__file__).parent
    kernels = tmp_path / "sidegan" / "kernels"
    kernels.mkdir(parents=True)
    (tmp_path / "sidegan" / "base").mkdir()
    modules = "__init__", "errors", "base/__init__", "base/cache", "kernels/__init__", "kernels/jit"
    for file in (f"{module}.py" for module in modules):
        shutil.copy(source / file, tmp_path / "sidegan" / file)
    (kernels / "caller.py").write_text(CALLER)
    (kernels / "callee.py").write_text(CALLEE)
    return tmp_path


def test_concurrent_processes_compile_kernels_once_until_one_of_their_files_changes(folder):
    """Compiling is logged once; of older caches the last three are kept."""
    names = ("first", "second")
    both = [start(folder, name) for name in names]
    while not all(
        (folder / name).exists() or process.poll() is not None for name, process in zip(names, both)
    ):
        time.sleep(0.01)
    (folder / "go").touch()
    assert sorted(map(answer, both)) == ["6.0 0 0", "6.0 1 1"]
    (first,) = (folder / "cache").glob("kernels-*")
    for age in range(1, 5):  # caches of older versions
        older = first.with_name(f"kernels-{age}")
        older.mkdir()
        os.utime(older, 2 * (first.stat().st_mtime - 3600 * age,))
    (folder / "sidegan/kernels/callee.py").write_text(CALLEE.replace("s * y", "s * y + 1.0"))
    assert answer(start(folder)) == "7.0 1 1"
    left = {path.name for path in first.parent.glob("kernels-*")}
    assert len(left) == 4 and left > {first.name, "kernels-1", "kernels-2"}


def test_kernels_are_compiled_without_a_cache_folder(folder):
    (folder / "cache").write_text("a file")
    (folder / "go").touch()
    assert answer(start(folder)) == "6.0 1 1"
    assert not [*folder.rglob("*.nbi")]
