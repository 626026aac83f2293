"""Modified Fourier trajectories (Park 2006): from coefficients to joint motion.

Position, velocity and acceleration are linear in the coefficients, so a roll-out is a matrix product with
a basis that depends only on the time grid. The quintic that brings a joint to rest at both ends has a
closed form on time scaled to [0, 1]; rest is exact for any period.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from numbers import Integral, Real
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array, flatten, numbers, split
from sidegan.errors import ShapeError

_CACHED = 1_000_000  # time points × harmonics up to which a basis is cached: 16 MB
_KEPT = 32  # cached bases: half a gigabyte at worst, a few megabytes for the grids of a run
_OUTSIDE = 1e-6  # share of the period by which rounding may put a time outside it
_MOST = 10_000_000  # samples of a period, far more than a file or a figure needs
_SAME = 1e-4  # [rad or m; per s] tolerance of common ends, at rest

# Quintics over s = t / period, coefficients of s⁰ … s⁵. The first has unit slope at both ends, the second
# unit curvature; their values and other derivatives up to the second vanish there.
_SLOPE = (0.0, 1.0, 0.0, -10.0, 15.0, -6.0)
_CURVATURE = (0.0, 0.0, 0.5, -1.0, 0.5, 0.0)
_QUINTICS = np.array([_SLOPE, _CURVATURE]).T


class Motion(NamedTuple):
    """Joint motion on a time grid (T,) [s]: position [rad or m], velocity, acceleration, (B, T, J) each."""

    time: Array
    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class Trajectory:
    """A family of cyclic trajectories of ``joints`` joints that start and end at rest at ``home``."""

    joints: int  # number of joints J
    harmonics: int = 6  # number of Fourier harmonics H
    period: float = 16.0  # duration of one cycle [s]
    home: Sequence[float] | None = None  # joint positions [rad or m] at both ends, (J,); zeros when None

    def __post_init__(self) -> None:
        for name, count in (("joints", self.joints), ("harmonics", self.harmonics)):
            if not (isinstance(count, Integral) and count >= 1):
                raise ShapeError(f"{name} is {count!r}, expected a positive whole number")
        if not (isinstance(self.period, Real) and 0 < self.period < math.inf):
            raise ShapeError(f"period is {self.period!r}, expected a positive number of seconds")
        home = np.zeros(self.joints) if self.home is None else numbers(self.home, "home")
        if home.shape != (self.joints,) or not np.isfinite(home).all():
            raise ShapeError(f"home is {self.home}, expected {self.joints} finite joint positions")
        object.__setattr__(self, "home", tuple(home.tolist()))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of one trajectory's coefficients, (J, H, 2)."""
        return (self.joints, self.harmonics, 2)

    def check(self, c: Array) -> None:
        """Refuse coefficients that are not (B, J, H, 2) or hold non-finite numbers."""
        if c.ndim != 4 or c.shape[1:] != self.shape:
            raise ShapeError(f"coefficients are {c.shape}, expected (B, {', '.join(map(str, self.shape))})")
        finite = flatten(np.isfinite(c), 1).all(1)
        if not finite.all():
            raise ShapeError(f"coefficients[{int(finite.argmin())}] are not finite")

    def times(self, rate: float) -> Array:
        """Uniform time grid [s] over one period with both ends, (T,), at ``rate`` [Hz].

        If the period is not a whole number of samples, the nearest rate for which it is applies.

        Raises:
            ShapeError: when the rate leaves no sample in a period, or too many for the memory.
        """
        samples = self.period * rate if isinstance(rate, Real) else np.nan
        if not (0 < samples <= _MOST and round(samples) >= 1):
            raise ShapeError(f"rate is {rate!r} Hz, expected 1 to {_MOST:,} samples in {self.period} s")
        return np.linspace(0.0, self.period, round(samples) + 1)

    def grid(self, count: int) -> Array:
        """Uniform time grid [s] of cell centres over one period, (count,)."""
        if count < 1:
            raise ShapeError(f"a time grid needs at least one sample, got {count}")
        return (np.arange(count) + 0.5) * (self.period / count)

    def basis(self, times: Array, order: int) -> Array:
        """Derivative ``order`` (0: position … 4) of the basis at ``times`` [s], (T, H, 2).

        Derivatives up to the second vanish at both ends. The third does not: the jerk begins and ends with a
        step, and is continuous in between.
        """
        times = np.asarray(times, float)
        make = _basis if len(times) * self.harmonics <= _CACHED else _basis.__wrapped__
        # A copy, so that callers cannot change the cached array.
        return make(self.harmonics, self.period, times.tobytes(), order).copy()

    def derivative_bound(self, order: int) -> Array:
        """Upper bound of the absolute derivative ``order``, 4 or more, of each basis function, (H, 2).

        A wave's bound is its amplitude. The quintic's fourth derivative is linear, so that its peak is at an
        end; its fifth is constant.
        """
        w = _frequencies(self.harmonics, self.period)
        peaks = np.abs(_power_derivatives(np.array([0.0, 1.0]), order) @ _QUINTICS).max(0)
        return w[:, None] ** (order - 1) + peaks * _quintic_scales(w, self.period, order)

    def roll_out(self, c: Array, times: Array) -> Motion:
        """Joint motion, (B, T, J) each, of coefficients [rad/s], (B, J, H, 2), at ``times`` [s], (T,).

        Source: Park 2006, eq. 6, with velocity coefficients.
        """
        return Motion(times, *self._derivatives(c, times, range(3)))

    def derivative(self, c: Array, times: Array, order: int) -> Array:
        """Time derivative ``order`` of the joint position [rad/s^order], (B, T, J)."""
        return self._derivatives(c, times, [order])[0]

    def _derivatives(self, c: Array, times: Array, orders: Sequence[int]) -> list[Array]:
        self.check(c)
        # In blocks: the whole basis of a long trajectory would take gigabytes.
        parts: list[list[Array]] = [[] for _ in orders]
        flat = c.reshape(-1, 2 * self.harmonics)  # a single product for all trajectories
        for block in split(times, max(1, _CACHED // self.harmonics)):
            for part, order in zip(parts, orders):  # inner loop, since all orders share a block's waves
                basis = flatten(self.basis(block, order), 1)
                part.append((flat @ basis.T).reshape(len(c), self.joints, len(block)).swapaxes(1, 2))
        joined = [np.concatenate(part, 1) for part in parts]
        return [x if order else x + np.asarray(self.home) for x, order in zip(joined, orders)]


def concatenate(motion: Motion) -> Motion:
    """A single motion (1, B·(T−1)+1, J) of B cyclic ones executed in sequence.

    The grid must include both ends (``Trajectory.times``); the shared sample at rest is kept once.

    Raises:
        ShapeError: when there is nothing to join, or the motions do not meet at rest.
    """
    batch, count, _ = motion.position.shape
    if batch < 1 or count < 2:
        raise ShapeError(f"concatenation needs a motion of two samples or more, got {batch} of {count}")
    ends, speeds = motion.position[:, [0, -1]], motion.velocity[:, [0, -1]]
    if not max(np.abs(ends - ends[0, 0]).max(), np.abs(speeds).max()) <= _SAME:
        raise ShapeError(
            "motions to concatenate must begin and end at rest at one position, see Trajectory.times"
        )
    period = motion.time[-1] - motion.time[0]
    starts = np.arange(batch) * period
    time = (starts[:, None] + motion.time[None, :-1] - motion.time[0]).reshape(-1)

    def join(x: Array) -> Array:
        return np.concatenate([x[:, :-1].reshape(-1, x.shape[-1]), x[-1:, -1]])[None]

    time = np.append(time, batch * period)
    return Motion(time, join(motion.position), join(motion.velocity), join(motion.acceleration))


@lru_cache(maxsize=_KEPT)
def _basis(harmonics: int, period: float, instants: bytes, order: int) -> Array:
    times = np.frombuffer(instants)
    if not ((times >= -_OUTSIDE * period) & (times <= (1 + _OUTSIDE) * period)).all():
        raise ShapeError(f"times run from {times.min()} to {times.max()} s, expected 0 to {period} s")
    s = times / period
    sine, cosine = _waves(harmonics, s.tobytes())
    # The waves are sin(kωt)/kω and −cos(kωt)/kω; each derivative shifts them by a quarter period, times kω.
    turned = ((sine, -cosine), (cosine, sine), (-sine, cosine), (-cosine, -sine))[order % 4]
    w = _frequencies(harmonics, period)
    basis = np.stack(turned, -1) * (w ** (order - 1))[:, None]
    if order == 0:
        basis[..., 1] += w**-1
    quintics = _power_derivatives(s, order) @ _QUINTICS
    return basis - quintics[:, None] * _quintic_scales(w, period, order)


@lru_cache(maxsize=1)
def _waves(harmonics: int, shares: bytes) -> tuple[Array, Array]:
    """Sine and cosine of each harmonic at shares of the period, (T, H) each; used by all orders."""
    # Whole turns are removed while that is exact, so that the waves match the quintic at the end.
    angle = 2 * np.pi * (np.frombuffer(shares)[:, None] * np.arange(1, harmonics + 1) % 1.0)
    return np.sin(angle), np.cos(angle)


def _frequencies(harmonics: int, period: float) -> Array:
    """Angular frequencies kω [rad/s], (H,)."""
    return 2 * np.pi / period * np.arange(1, harmonics + 1)


def _quintic_scales(w: Array, period: float, order: int) -> Array:
    """Factors of the quintics' derivative ``order`` with respect to s, (H, 2).

    The quintics cancel the sine waves' velocity of 1 and the cosine waves' acceleration of kω at both ends.
    """
    return np.stack([np.full_like(w, period ** (1 - order)), w * period ** (2.0 - order)], -1)


def _power_derivatives(s: Array, order: int) -> Array:
    """Derivative ``order`` of the powers 1, s, …, s⁵, (T, 6)."""
    powers = range(len(_QUINTICS))  # math.perm is zero for those below the order
    return np.stack([math.perm(power, order) * s ** max(power - order, 0) for power in powers], -1)
