"""What the machine would allow: measured peaks, and arithmetic counted where torch carries it out."""

import os
import time
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from benchmarks.timing import threads
from sidegan.motion.compiled import VARIABLE

_SIZE = 1024  # of the matrices multiplied
_COPIED = 2**25  # float64 numbers copied: 256 MB, more than any cache
_TRIES = 5
_ONE_EACH = {  # one operation per number that comes out
    *("add", "sub", "rsub", "mul", "div", "neg", "reciprocal", "abs", "sqrt", "rsqrt", "sin", "cos", "exp"),
    *("log", "maximum", "minimum", "clamp", "clamp_min", "clamp_max", "pow", "square", "sigmoid", "tanh"),
    *("relu", "copysign", "sign", "sgn", "threshold_backward"),
}
_TWO_EACH = {"lerp", "addcmul", "addcdiv"}
_ONE_PER_INPUT = {"sum", "mean", "norm", "linalg_vector_norm", "amax", "amin", "min", "max"}


@lru_cache
def peak(count: int, dtype: torch.dtype = torch.float64) -> float:
    """Floating-point operations per second of a matrix product on ``count`` threads."""
    a = torch.rand(_SIZE, _SIZE, dtype=dtype)
    with threads(count):
        return 2 * _SIZE**3 / _fastest(lambda: a @ a)


@lru_cache
def bandwidth(count: int) -> float:
    """Bytes read and written per second by a copy on ``count`` threads."""
    a = torch.rand(_COPIED, dtype=torch.float64)
    b = torch.empty_like(a)
    with threads(count):
        return 2 * a.nbytes / _fastest(lambda: b.copy_(a))


def operations(work: Callable[[], object]) -> float:
    """Additions, multiplications and elementary functions of ``work``, by the plain torch code."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = "torch"
    try:
        with _Count() as count:
            work()
    finally:
        os.environ.pop(VARIABLE)
        if before is not None:
            os.environ[VARIABLE] = before
    return count.total


def _fastest(work: Callable[[], object]) -> float:
    seconds = []
    for _ in range(_TRIES):
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    return min(seconds)


class _Count(TorchDispatchMode):
    """Counts arithmetic: twice the products of a matrix product, one per number elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.total = 0.0

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        out = func(*args, **(kwargs or {}))
        name = func.overloadpacket.__name__.rstrip("_")
        parts = out if isinstance(out, (tuple, list)) else (out,)
        first = next((x for x in parts if isinstance(x, Tensor)), None)
        if first is None:
            return out
        if name in ("mm", "bmm", "addmm", "baddbmm"):
            inner = args[-2].shape[-1]
            self.total += 2 * inner * first.numel()
        elif name in _ONE_EACH:
            self.total += first.numel()
        elif name in _TWO_EACH:
            self.total += 2 * first.numel()
        elif name in _ONE_PER_INPUT:
            self.total += args[0].numel()
        return out
