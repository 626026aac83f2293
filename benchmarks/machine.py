"""What the machine is and would allow: measured peaks, and arithmetic counted where torch carries it out."""

import os
import platform
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest.mock import patch

import torch
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from benchmarks.timing import threads, timed
from sidegan.motion.compiled import VARIABLE

_SIZE = 1024  # of the matrices multiplied
_COPIED = 2**25  # float64 numbers copied: 256 MB, more than any cache
_TRIES = 5
# Elementwise operations that count once per number that comes out, and sums, once per number that goes in;
# products of matrices are torch's to count.
_PER_OUTPUT = """
add sub rsub mul div neg reciprocal abs sqrt rsqrt sin cos exp log maximum minimum clamp clamp_min clamp_max
pow square sigmoid tanh relu copysign sign sgn threshold_backward
"""
_TWICE_PER_OUTPUT = "lerp addcmul addcdiv"
_PER_INPUT = "sum mean norm linalg_vector_norm amax amin min max"


@cache
def peak(count: int, dtype: torch.dtype = torch.float64) -> float:
    """Floating-point operations per second of a matrix product on ``count`` threads."""
    a = torch.rand(_SIZE, _SIZE, dtype=dtype)
    with threads(count):
        return 2 * _SIZE**3 / _fastest(lambda: a @ a)


@cache
def bandwidth(count: int) -> float:
    """Bytes read and written per second by a copy on ``count`` threads."""
    a = torch.rand(_COPIED, dtype=torch.float64)
    b = torch.empty_like(a)
    with threads(count):
        return 2 * a.nbytes / _fastest(lambda: b.copy_(a))


def operations(work: Callable[[], object]) -> float:
    """Additions, multiplications and elementary functions of ``work``, by the plain torch code."""
    formulas = {
        getattr(torch.ops.aten, name): formula
        for names, formula in ((_PER_OUTPUT, _outputs), (_TWICE_PER_OUTPUT, _twice), (_PER_INPUT, _inputs))
        for word in names.split()
        for name in (word, f"{word}_")
        if hasattr(torch.ops.aten, name)
    }
    counter = FlopCounterMode(display=False, custom_mapping=formulas)
    with patch.dict(os.environ, {VARIABLE: "torch"}), counter:
        work()
    return float(counter.get_total_flops())


def machine() -> dict[str, Any]:
    """What the numbers were measured on."""
    return {
        "cpu": _cpu(),
        "cores": len(os.sched_getaffinity(0)),
        "peak_gflops_float64": {str(n): peak(n) / 1e9 for n in (1, 2)},
        "copy_gigabytes_per_second": bandwidth(2) / 1e9,
        "torch": torch.__version__,
        "numba": version("numba"),
        "python": platform.python_version(),
    }


def _fastest(work: Callable[[], object]) -> float:
    return min(timed(work).wall for _ in range(_TRIES))


def _outputs(*_: Any, out_val: Tensor | tuple[Tensor, ...], **__: Any) -> int:
    return (out_val[0] if isinstance(out_val, tuple) else out_val).numel()


def _twice(*_: Any, out_val: Tensor, **__: Any) -> int:
    return 2 * out_val.numel()


def _inputs(x: Tensor, *_: Any, **__: Any) -> int:
    return x.numel()


for _formula in (_outputs, _twice, _inputs):
    _formula._get_raw = True  # type: ignore[union-attr] # takes tensors, not their shapes


def _cpu() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.machine()
