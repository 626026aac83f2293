"""Compilation of kernels: once, then loaded from a cache on disk.

Kernels call each other without a Python wrapper; only kernels called from Python get one, because it takes
longer to compile than most kernels. What kernels call is cached, too, in the same folder: numba's public way
to such functions, ``register_jitable``, cannot be told where, and without a cache every process compiles
them again. Without reference counting (``_nrt``) kernels are twice as fast but cannot allocate memory: the
caller passes scratch arrays.
"""

import hashlib
import logging
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial, update_wrapper
from inspect import isfunction
from pathlib import Path
from types import ModuleType
from typing import Any

import llvmlite.binding
import numba
from filelock import FileLock, Timeout
from numba import types
from numba.extending import models, register_jitable, register_model, typeof_impl

from sidegan.base.cache import user_cache

_OPTIONS: Any = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "no_cfunc_wrapper": True,
    "_nrt": False,
}
_INNER: Any = {"no_cpython_wrapper": True}
_ANY_ORDER: Any = {"fastmath": {"contract", "reassoc"}}
_PATIENCE = 120.0  # [s] to wait for another process that compiles a kernel, before compiling it too
_KEPT = 3  # cached older versions of the kernels

_log = logging.getLogger(__name__)

Function = Callable[..., Any]


class Kernel:
    """A compiled function that can be called from Python and from other kernels."""

    def __init__(self, function: Function, options: Any) -> None:
        update_wrapper(self, function)
        folder = _folder()
        options = options | {"cache": folder is not None}
        with _cached_in(folder and folder / "inner"):
            self.inner = numba.njit(**_INNER, **options)(function)
        with _cached_in(folder):
            self._compiled = numba.njit(**options)(function)
        self._name, self._called = f"{function.__module__}.{function.__qualname__}", False

    def __call__(self, *arguments: Any) -> Any:
        """Call the kernel from Python."""
        if self._called:
            return self._compiled(*arguments)
        with _turn(_folder(), self._name):
            result = self._compiled(*arguments)
        self._called = True
        return result

    def compile_for(self, *arguments: Any) -> None:
        """Compile the version that other kernels call with arguments of these types, unless compiled."""
        self.inner.compile(tuple(map(numba.typeof, arguments)))

    def to_be_compiled(self) -> bool:
        """Whether no process on this machine has compiled the kernel or is compiling it."""
        if self._called or (folder := _folder()) is None or (folder / f"{self._name}.compiled").exists():
            return False
        try:
            with FileLock(folder / f"{self._name}.lock", timeout=0):
                return True
        except (OSError, Timeout):
            return False


class _Inner(types.Dispatcher):
    """Type of a kernel called from another: compiled once per type, not per constant, for tuples.

    Constants outside tuples stay: they tell the compiler that an index is not negative.
    """

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Signature of a call, without the constants in tuples."""
        args = tuple(types.unliteral(x) if isinstance(x, types.BaseTuple) else x for x in args)
        return super().get_call_type(context, args, kws)


register_model(_Inner)(models.OpaqueModel)


@typeof_impl.register(Kernel)
def _typeof(kernel: Kernel, _: Any) -> Any:
    return _Inner(kernel.inner)


@contextmanager
def _turn(folder: Path | None, name: str) -> Iterator[None]:
    """Context for a kernel's first call in a process, which compiles it or loads it from the cache.

    If several processes need a kernel that is not compiled yet, one compiles it and the others wait.
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
    """Cache functions decorated within the block in a folder."""
    config: Any = numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder or "")
    try:
        yield
    finally:
        config.CACHE_DIR = before


@cache
def _folder() -> Path | None:
    """Cache of this version of the kernels in the user's cache; None if it is not writable."""
    if (within := user_cache()) is None:
        return None
    # also of what numba tells compiled code apart by
    digest = hashlib.sha256(f"{numba.__version__} {llvmlite.binding.get_host_cpu_name()}".encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    folder = within / f"kernels-{digest.hexdigest()[:16]}"
    with suppress(OSError):  # it exists, or cannot be made
        folder.mkdir()
        _remove_old(within, folder)
    return folder if os.access(folder, os.W_OK) else None


def _remove_old(within: Path, new: Path) -> None:
    """Remove caches of other versions except the most recent ones."""
    others = [path for path in within.glob("kernels-*") if path.name != new.name]
    with suppress(OSError):  # another process may be removing them too
        for path in sorted(others, key=lambda path: path.stat().st_mtime)[:-_KEPT]:
            shutil.rmtree(path, ignore_errors=True)


@cache
def _tell() -> None:
    """Log once that compilation takes a while."""
    _log.info("compiling for this processor, once, which takes up to a minute")


def inline_functions(module: ModuleType) -> None:
    """Let kernels call the functions of a module, inlined; in Python they stay functions."""
    for function in vars(module).values():
        if isfunction(function):
            register_jitable(forceinline=True, **_OPTIONS)(function)


kernel = partial(Kernel, options=_OPTIONS)
part = numba.njit(inline="always", **_OPTIONS)  # inlined into its callers, never compiled on its own
inline = partial(Kernel, options=_OPTIONS | {"forceinline": True})  # a call would cost more than the work
kernel_in_any_order = partial(Kernel, options=_OPTIONS | _ANY_ORDER)  # lets sums over lanes be vectorised
inline_in_any_order = partial(Kernel, options=_OPTIONS | _ANY_ORDER | {"forceinline": True})
