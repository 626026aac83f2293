"""How kernels are compiled: once, then from a cache on disk.

Without reference counts (``_nrt``) they are twice as fast, and in return cannot allocate anything: whoever
calls one gives it room to work in.
"""

import hashlib
import logging
import re
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
# Modules of this package that a source imports: from sidegan….lanes import, from sidegan… import lanes, links
_NAMED = re.compile(
    rf"^(?:from|import) {re.escape(__package__)}(?:[.](\w+)| import (?:\(([^)]*)\)|(.*)))", re.MULTILINE
)
_PATIENCE = 120.0  # [s] with another process that compiles a function, before compiling it as well

log = logging.getLogger(__name__)

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class _Cache(FunctionCache):
    """Cache on disk of a function, stale as soon as a file changes that its own one imports, directly or not.

    Numba's own looks at the function's file alone, although a compiled function contains those it calls.
    Where several processes need a function that is not there, one of them compiles it and the others wait.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        stamp = _digest(Path(function.__code__.co_filename))
        folder = Path(self._impl.locator.get_cache_path())
        self._cache_file = IndexDataCacheFile(str(folder), self._impl.filename_base, source_stamp=stamp)
        self._compiling = FileLock(folder / f"{self._impl.filename_base}.lock", timeout=_PATIENCE)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function, or None when this process has to compile it."""
        there = super().load_overload(sig, target_context)
        if there is None:
            with suppress(OSError, Timeout):
                self._impl.locator.ensure_cache_path()
                self._compiling.acquire()
                there = super().load_overload(sig, target_context)
        if there is None:
            _tell()
        else:
            self._compiling.release()
        return there

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a function that was compiled."""
        try:
            super().save_overload(sig, data)
        finally:
            self._compiling.release()


@cache
def _tell() -> None:
    """Say once why nothing seems to happen."""
    log.info("compiling for this processor, once, which takes up to two minutes")


@cache
def _digest(source: Path) -> str:
    """Digest of the sources that kernels of a file are made of."""
    found: set[Path] = set()
    more = {source}
    while more:
        found.add(one := more.pop())
        more |= _imported(one) - found
    digest = hashlib.sha256()
    for path in sorted(found):
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


@cache
def _imported(source: Path) -> frozenset[Path]:
    """Files of this package that a source imports, wherever it lies."""
    named = " ".join(" ".join(one) for one in _NAMED.findall(source.read_text("utf-8")))
    words = set(re.findall(r"\w+", named))
    folders = {source.parent, Path(__file__).parent}
    return frozenset(path for folder in folders for path in folder.glob("*.py") if path.stem in words)


def _jit(**options: Any) -> Decorator:
    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        dispatcher = numba.njit(**{**_OPTIONS, **options})(function)
        with suppress(RuntimeError):  # numba finds no folder that it may write to
            dispatcher._cache = _Cache(function)
        return dispatcher

    return decorate


def share(module: ModuleType) -> None:
    """Let kernels call the functions of a module, inlined; in Python they stay functions."""
    for function in vars(module).values():
        if isfunction(function):
            register_jitable(forceinline=True, **_OPTIONS)(function)


kernel = _jit()
inline = _jit(forceinline=True)  # a call would pass up to two hundred numbers
kernel_in_any_order = _jit(fastmath=_ANY_ORDER)  # its sums over lanes are sums of vectors
inline_in_any_order = _jit(forceinline=True, fastmath=_ANY_ORDER)
