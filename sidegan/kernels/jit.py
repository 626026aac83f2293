"""How kernels are compiled: once, then from a cache on disk.

A kernel that other kernels call is compiled into them; only one that Python calls gets what Python needs,
which takes longer to compile than most kernels. Without reference counts (``_nrt``) kernels are twice as
fast, and in return cannot allocate anything: the caller passes scratch arrays.
"""

import hashlib
import logging
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, update_wrapper
from inspect import isfunction
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from filelock import FileLock, Timeout
from numba import types
from numba.extending import models, register_jitable, register_model, typeof_impl

_OPTIONS: Any = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "no_cfunc_wrapper": True,
    "_nrt": False,
}
_INNER: Any = {"no_cpython_wrapper": True}
_ANY_ORDER: Any = {"contract", "reassoc"}
_PATIENCE = 120.0  # [s] with another process that compiles a kernel, before compiling it as well
_KEPT = 3  # caches of other versions of the kernels

log = logging.getLogger(__name__)

Function = Callable[..., Any]


class Kernel:
    """A compiled function that other kernels can call, and Python.

    Args:
        function: the function.
        options: of ``numba.njit``.
    """

    def __init__(self, function: Function, options: Any) -> None:
        update_wrapper(self, function)
        folder = _folder()
        options["cache"] = folder is not None
        with _cached_in(folder and folder / "inner"):
            self.inner = numba.njit(**_INNER, **options)(function)
        with _cached_in(folder):
            self._compiled = numba.njit(**options)(function)
        self._name, self._called = f"{function.__module__}.{function.__qualname__}", False

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        if self._called:
            return self._compiled(*arguments)
        with _turn(_folder(), self._name):
            result = self._compiled(*arguments)
        self._called = True
        return result

    def compile_for(self, *arguments: Any) -> None:
        """Compile it, unless that was done, as other kernels call it with arguments of these types."""
        self.inner.compile(tuple(map(numba.typeof, arguments)))

    def to_be_compiled(self) -> bool:
        """Whether nobody has compiled it on this machine, or does so now."""
        if self._called or (folder := _folder()) is None or (folder / f"{self._name}.compiled").exists():
            return False
        try:
            with FileLock(folder / f"{self._name}.lock", timeout=0):
                return True
        except (OSError, Timeout):
            return False


class _Inner(types.Dispatcher):
    """Type of a kernel within another: compiled once for all tuples, whatever constants are in them.

    Constants by themselves are worth it: they tell the compiler that an index is not negative.
    """

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Signature of a call."""
        args = tuple(types.unliteral(x) if isinstance(x, types.BaseTuple) else x for x in args)
        return super().get_call_type(context, args, kws)


register_model(_Inner)(models.OpaqueModel)


@typeof_impl.register(Kernel)
def _typeof(kernel: Kernel, _: Any) -> Any:
    return _Inner(kernel.inner)


def _kernel(**options: Any) -> Callable[[Function], Kernel]:
    return lambda function: Kernel(function, _OPTIONS | options)


@contextmanager
def _turn(folder: Path | None, name: str) -> Iterator[None]:
    """The first call of a kernel in a process, which compiles it or reads it from the cache.

    Where several processes need a kernel that was never compiled, one compiles it and the others wait.
    """
    if folder is None:
        _tell()
        yield
        return
    compiled, lock = folder / f"{name}.compiled", FileLock(folder / f"{name}.lock", timeout=_PATIENCE)
    if not compiled.exists():
        with suppress(OSError, Timeout):
            lock.acquire()
    if not compiled.exists():
        _tell()
    try:
        yield
        with suppress(OSError):
            compiled.touch()
    finally:
        lock.release()


@contextmanager
def _cached_in(folder: Path | None) -> Iterator[None]:
    """Functions that are decorated within the block are cached in a folder, and no others."""
    config: Any = numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder or "")
    try:
        yield
    finally:
        config.CACHE_DIR = before


@cache
def _folder() -> Path | None:
    """Folder for these kernels, named by a digest of all their sources; None where nothing can be written.

    It lies in the folder that ``SIDEGAN_CACHE`` names, or in the user's cache.
    """
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    user = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    try:
        within = Path(os.environ.get("SIDEGAN_CACHE") or Path(user).expanduser() / "sidegan")
        folder = within.absolute() / f"kernels-{digest.hexdigest()[:16]}"
        if not folder.exists():
            folder.mkdir(parents=True, exist_ok=True)
            _remove_old(within, folder)
    except (OSError, RuntimeError):  # the latter of a user without a home
        return None
    return folder if os.access(folder, os.W_OK) else None


def _remove_old(within: Path, new: Path) -> None:
    """Remove caches of other versions but for the last few."""
    others = [path for path in within.glob("kernels-*") if path.name != new.name]
    with suppress(OSError):  # another process removes them too
        for path in sorted(others, key=lambda path: path.stat().st_mtime)[:-_KEPT]:
            shutil.rmtree(path, ignore_errors=True)


@cache
def _tell() -> None:
    """Say once why nothing seems to happen."""
    log.info("compiling for this processor, once, which takes up to a minute")


def share(module: ModuleType) -> None:
    """Let kernels call the functions of a module, inlined; in Python they stay functions."""
    for function in vars(module).values():
        if isfunction(function):
            register_jitable(forceinline=True, **_OPTIONS)(function)


kernel = _kernel()
part = numba.njit(inline="always", **_OPTIONS)  # compiled where it is called, never by itself
inline = _kernel(forceinline=True)  # a call would cost more than the work
kernel_in_any_order = _kernel(fastmath=_ANY_ORDER)  # its sums over lanes are sums of vectors
inline_in_any_order = _kernel(forceinline=True, fastmath=_ANY_ORDER)
