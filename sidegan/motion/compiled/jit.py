"""How kernels are compiled: once, then from a cache on disk.

Without reference counts (``_nrt``) they are twice as fast, and in return cannot allocate anything: whoever
calls one gives it room to work in.
"""

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from inspect import isfunction
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from filelock import FileLock, Timeout
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.extending import register_jitable

_OPTIONS: Any = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}
_ANY_ORDER: Any = {"contract", "reassoc"}
_PATIENCE = 120.0  # [s] with another process that compiles a function, before compiling it as well

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class _Cache(FunctionCache):
    """Cache on disk of a function, stale as soon as any file of this package changes.

    Numba's own looks at the function's file alone, although a compiled function contains those it calls.
    Where several processes need a function that is not there, one of them compiles it and the others wait.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = IndexDataCacheFile(
            self._impl.locator.get_cache_path(), self._impl.filename_base, source_stamp=_digest()
        )
        folder = Path(self._impl.locator.get_cache_path())
        self._compiling = FileLock(folder / f"{self._impl.filename_base}.lock", timeout=_PATIENCE)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function, or None when this process has to compile it."""
        there = super().load_overload(sig, target_context)
        if there is None:
            with suppress(OSError, Timeout):
                self._impl.locator.ensure_cache_path()
                self._compiling.acquire()
                there = super().load_overload(sig, target_context)
        if there is not None:
            self._compiling.release()
        return there

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a function that was compiled."""
        try:
            super().save_overload(sig, data)
        finally:
            self._compiling.release()


@cache
def _digest() -> str:
    """Digest of the sources of all kernels."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _jit(**options: Any) -> Decorator:
    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        dispatcher = numba.njit(**{**_OPTIONS, **options})(function)
        with suppress(RuntimeError):  # numba finds no folder that it may write to
            dispatcher._cache = _Cache(function)
        return dispatcher

    return decorate


def share(module: ModuleType) -> None:
    """Let kernels call the functions of a module, inlined; elsewhere they stay plain functions."""
    for function in vars(module).values():
        if isfunction(function):
            register_jitable(forceinline=True, **_OPTIONS)(function)


kernel = _jit()
inline = _jit(forceinline=True)  # a call would pass up to two hundred numbers
kernel_in_any_order = _jit(fastmath=_ANY_ORDER)  # its sums over lanes are sums of vectors
inline_in_any_order = _jit(forceinline=True, fastmath=_ANY_ORDER)
