"""The basis functions of modified Fourier trajectories at single times, compiled."""

import math

from sidegan.kernels.chain import Array
from sidegan.kernels.jit import inline, kernel


@inline
def _quintics(s: float, order: int) -> tuple[float, float]:
    """Derivatives of the quintics with unit slope and curvature at both ends; see ``motion.trajectory``."""
    if order == 0:
        cube = s * s * s
        return s + cube * (-10 + s * (15 - 6 * s)), s * s * (0.5 + s * (-1 + 0.5 * s))
    if order == 1:
        square = s * s
        return 1 + square * (-30 + s * (60 - 30 * s)), s * (1 + s * (-3 + 2 * s))
    if order == 2:
        return s * (-60 + s * (180 - 120 * s)), 1 + s * (-6 + 6 * s)
    if order == 3:
        return -60 + s * (360 - 360 * s), -6 + 12 * s
    return 360 - 720 * s, 12.0


@kernel
def waves(shares: Array, basis: Array) -> None:
    """Write derivatives from none on, at most the fourth, at shares of 1 s, (T, orders, 2 H)."""
    for n in range(len(shares)):
        s = shares[n]
        sine, cosine = math.sin(2 * math.pi * s), math.cos(2 * math.pi * s)
        a, b = 0.0, 1.0  # sine and cosine of k turns
        for k in range(basis.shape[2] // 2):
            a, b = a * cosine + b * sine, b * cosine - a * sine
            w = 2 * math.pi * (k + 1)
            for order in range(basis.shape[1]):
                slope, curve = _quintics(s, order)
                if order == 0:
                    one, two = a / w, (1 - b) / w
                elif order == 1:
                    one, two = b, a
                elif order == 2:
                    one, two = -a * w, b * w
                elif order == 3:
                    one, two = -b * w * w, -a * w * w
                else:
                    one, two = a * w * w * w, -b * w * w * w
                basis[n, order, 2 * k] = one - slope
                basis[n, order, 2 * k + 1] = two - w * curve
