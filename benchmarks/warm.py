"""A process that has imported what is heavy, and runs tests in copies of itself, which begin at once.

It imports nothing of the project, so that its copies see a project as it lies on the disk when they begin.
Requests and answers are JSON, a line each, on its standard input and output.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NamedTuple, Self, cast

HEAVY = ("torch", "pandas", "pyarrow.parquet", "scipy.signal", "scipy.optimize", "numba", "pinocchio", "coal")
HEAVY += ("mujoco", "trimesh", "matplotlib.figure", "plotly.graph_objects", "hydra", "hypothesis", "pytest")
_LOOK = 0.02  # [s] between two looks at whether a copy has ended


class Ran(NamedTuple):
    """What came of a run of tests."""

    code: int | None  # of pytest; negative for a signal, None where it was ended on the clock
    output: str
    seconds: float  # of the processor


class Bounds(NamedTuple):
    """What a run of tests may take before it is ended."""

    patience: int  # [s] of the processor
    longest: float  # [s] on the clock
    room: int  # [bytes] of addresses of a process


class Warm:
    """The process; it ends with the block.

    Args:
        heavy: modules that it imports, as far as they are installed.
    """

    def __init__(self, heavy: tuple[str, ...] = HEAVY) -> None:
        # -P: no folder of this project is on the path of what is imported
        command = [sys.executable, "-P", __file__, *heavy]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, arguments: list[str], root: Path, kernels: Path, bounds: Bounds) -> Ran:
        """Run pytest on the project at a root.

        Args:
            arguments: of pytest.
            root: of the project; becomes the current folder.
            kernels: folder where compiled kernels are kept.
            bounds: after which it is ended.
        """
        request = {"root": str(root.resolve()), "kernels": str(kernels.resolve()), "arguments": arguments}
        request |= bounds._asdict()
        to, answers = cast("IO[str]", self._process.stdin), cast("IO[str]", self._process.stdout)
        to.write(f"{json.dumps(request)}\n")
        to.flush()
        return Ran(**json.loads(answers.readline()))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            cast("IO[str]", stream).close()


def _answer(request: dict[str, Any]) -> dict[str, Any]:
    """Run tests in a copy of this process, and everything that they start in its group."""
    before = _spent()
    with tempfile.TemporaryFile() as output:
        copy = os.fork()
        if not copy:
            _become(request, output.fileno())
        code = _waited(copy, request["longest"])
        with suppress(ProcessLookupError):
            os.killpg(copy, signal.SIGKILL)  # what tests have left running
        output.seek(0)
        words = output.read().decode(errors="replace")
    return {"code": code, "output": words, "seconds": _spent() - before}


def _become(request: dict[str, Any], output: int) -> None:
    """Be pytest, until the end of the process."""
    import pytest

    code = 70
    try:
        os.setsid()
        for stream in (1, 2):
            os.dup2(output, stream)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        resource.setrlimit(resource.RLIMIT_CPU, (request["patience"],) * 2)
        resource.setrlimit(resource.RLIMIT_AS, (request["room"],) * 2)
        os.chdir(request["root"])
        sys.path.insert(0, request["root"])
        # Commands that tests start are those of the project at this root too.
        os.environ |= {"PYTHONPATH": request["root"], "NUMBA_CACHE_DIR": request["kernels"]}
        if "numba" in sys.modules:
            sys.modules["numba"].config.CACHE_DIR = request["kernels"]
        code = int(pytest.main(request["arguments"]))
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


def _waited(copy: int, longest: float) -> int | None:
    """Exit code of a copy; None when it had to be ended."""
    end = time.monotonic() + longest
    while time.monotonic() < end:
        found, status = os.waitpid(copy, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(_LOOK)
    os.killpg(copy, signal.SIGKILL)
    os.waitpid(copy, 0)
    return None


def _spent() -> float:
    """CPU time of the copies that have ended, and of what they have waited for [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _serve(heavy: list[str]) -> None:
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what imports print is no answer
    for name in heavy:
        with suppress(ImportError):
            import_module(name)
    for line in sys.stdin:
        answers.write(f"{json.dumps(_answer(json.loads(line)))}\n")
        answers.flush()


if __name__ == "__main__":
    _serve(sys.argv[1:])
