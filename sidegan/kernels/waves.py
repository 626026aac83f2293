"""Sine and cosine together, in a loop that the compiler vectorises.

The angle minus whole quarter turns lies within ±π/4, where the Taylor series are exact to rounding.
"""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.jit import kernel

_QUARTERS = 2 / math.pi  # quarter turns per radian
# A quarter turn in three parts; the first two have 33 bits, so that their integer multiples are exact.
_FIRST, _SECOND, _THIRD = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
_S = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(9))  # of x, x³, x⁵ …
_C = tuple((-1.0) ** n / math.factorial(2 * n) for n in range(10))  # of 1, x², x⁴ …


@kernel
def waves(x: Array, sine: Array, cosine: Array) -> None:
    """Sine and cosine of angles [rad], (N,) each, up to a million, to about one rounding error."""
    for n in range(len(x)):
        k = np.floor(x[n] * _QUARTERS + 0.5)
        r = x[n] - k * _FIRST - k * _SECOND - k * _THIRD
        z = r * r
        s = _S[7] + z * _S[8]
        c = _C[8] + z * _C[9]
        s = _S[5] + z * (_S[6] + z * s)
        c = _C[6] + z * (_C[7] + z * c)
        s = _S[3] + z * (_S[4] + z * s)
        c = _C[4] + z * (_C[5] + z * c)
        s = _S[1] + z * (_S[2] + z * s)
        c = _C[2] + z * (_C[3] + z * c)
        s, c = r + r * z * s, 1.0 + z * (-0.5 + z * c)
        quarter = k - 4.0 * np.floor(0.25 * k)
        odd = quarter == 1.0 or quarter == 3.0
        u = c if odd else s
        v = s if odd else c
        sine[n] = -u if quarter >= 2.0 else u
        cosine[n] = -v if quarter == 1.0 or quarter == 2.0 else v
