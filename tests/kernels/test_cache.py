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
import logging, sys
import numpy as np
from sidegan.kernels import caller
told = logging.Handler()
told.emit = lambda record: words.append("compiling for this processor, once" in record.getMessage())
words, x = [], np.zeros(1)
logging.basicConfig(level="INFO", handlers=[told])
caller.other(x)
caller.three_times(x, 2.0)
print(x[0], sum(caller.three_times.stats.cache_hits.values()), sum(words))
"""
CALLER = """
from sidegan.kernels import callee
from sidegan.kernels.jit import kernel

times = callee.times

@kernel
def three_times(x, y):
    x[0] = times(3.0, y)

@kernel
def other(x):
    x[0] = 1.0
"""
CALLEE = """
from sidegan.kernels.jit import inline

@inline
def times(s, y):
    return s * y
"""


def start(code, folder, *arguments):
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.Popen(command, env=environment, cwd=folder, stdout=subprocess.PIPE, text=True)


def run(code, folder):
    process = start(code, folder)
    text = process.communicate(timeout=6000)[0].strip()
    assert process.returncode == 0
    return text


@pytest.fixture
def package(tmp_path):
    """Folder with a copy of what the cache needs of the package, and two kernels in two files."""
    source = Path(sidegan.__file__).parent
    compiled = tmp_path / "sidegan" / "kernels"
    compiled.mkdir(parents=True)
    for file in ("__init__.py", "errors.py", "kernels/__init__.py"):
        shutil.copy(source / file, tmp_path / "sidegan" / file)
    shutil.copy(source / "kernels/jit.py", compiled)
    (compiled / "caller.py").write_text(CALLER)
    (compiled / "callee.py").write_text(CALLEE)
    (compiled / "stranger.py").write_text(CALLEE)
    return compiled


def test_a_change_in_one_file_is_noticed_by_kernels_of_another(package):
    """Each compilation is logged once."""
    folder = package.parents[1]
    assert run(KERNEL, folder) == "6.0 0 1"
    assert run(KERNEL, folder) == "6.0 1 0"
    (package / "callee.py").write_text(CALLEE.replace("s * y", "s * y + 1.0"))
    assert run(KERNEL, folder) == "7.0 0 1"
    (package / "stranger.py").write_text(CALLEE.replace("s * y", "s - y"))  # that none of them imports
    assert run(KERNEL, folder) == "7.0 1 0"


@pytest.mark.parametrize(
    "words",
    [
        "from sidegan.kernels import callee",
        "from sidegan.kernels import formulas, callee  # both",
        "from sidegan.kernels import (\n    formulas,\n    callee,\n)",
        "from sidegan.kernels.callee import times",
        "from sidegan.kernels.callee import (\n    times,\n)",
        "import sidegan.kernels.callee as other",
        "from sidegan.kernels.between import times",
    ],
)
def test_whatever_way_a_file_is_imported_it_counts(tmp_path, words):
    from sidegan.kernels import jit

    texts = {"caller": words, "callee": "", "between": "from sidegan.kernels.callee import times"}
    digests = []
    for text in ("a = 1", "a = 2"):
        folder = tmp_path / text
        folder.mkdir()
        for name, lines in (texts | {"callee": text}).items():
            (folder / f"{name}.py").write_text(f"import math\n\n{lines}\n\nb = 3\n")
        digests.append(jit._digest(folder / "caller.py"))
    assert digests[0] != digests[1]


def test_kernels_are_compiled_where_there_is_no_place_for_a_cache(package):
    nowhere = "import numba.core.caching as c; c.CacheImpl._locator_classes = []\n"
    assert run(nowhere + KERNEL, package.parents[1]).startswith("6.0 0")


def test_processes_that_need_a_kernel_at_once_compile_it_once(package):
    wait = """
import sys, time
from pathlib import Path
from sidegan.kernels import caller
Path(sys.argv[1]).touch()
end = time.monotonic() + 60
while not Path("go").exists() and time.monotonic() < end:
    time.sleep(0.001)
"""
    folder, names = package.parents[1], ("first", "second")
    both = [start(wait + KERNEL, folder, name) for name in names]
    while not all((folder / name).exists() or one.poll() is not None for name, one in zip(names, both)):
        time.sleep(0.01)
    (folder / "go").touch()
    assert sorted(one.communicate(timeout=6000)[0].strip() for one in both) == ["6.0 0 1", "6.0 1 0"]
