"""Samples of joint states and torques, recorded or simulated."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.typed import NonNegative
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Motion

SAMPLES_AT_ONCE = 4096  # per piece: the regressor of a 7-joint arm then takes 16 MB


@dataclass(frozen=True, eq=False)
class Measurements:
    """S samples of a J-joint arm, (S, J) each.

    Raises:
        ShapeError: when shapes differ, are not (S, J), or values are not finite.
    """

    position: Array  # [rad or m]
    velocity: Array  # [rad/s or m/s]
    acceleration: Array  # [rad/s² or m/s²]
    torque: Array  # [N·m or N]
    # smooth sign of the velocity for Coulomb friction, low-pass filtered like the torque: a sign that jumps
    # does not explain a filtered torque; None computes it from the velocity
    sign: Array | None = None

    def __post_init__(self) -> None:
        for name, x in self._named().items():
            if x.ndim != 2 or x.shape != self.torque.shape:
                raise ShapeError(f"{name} is {x.shape}, expected (S, J) like torque {self.torque.shape}")
            if not np.isfinite(x.sum()):  # many times faster than testing each value
                bad = np.flatnonzero(~np.isfinite(x).all(1))
                if len(bad):
                    raise ShapeError(f"{name} of sample {bad[0]} is not finite")

    def __len__(self) -> int:
        return len(self.torque)

    def __getitem__(self, samples: slice) -> "Measurements":
        return Measurements(*(x[samples] for x in self._named().values()))

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.torque.shape[1]

    @property
    def states(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration."""
        return self.position, self.velocity, self.acceleration

    @property
    def inputs(self) -> tuple[Array, ...]:
        """Inputs of a model's regressor: the states, and the sign where there is one."""
        return self.states if self.sign is None else (*self.states, self.sign)

    def _named(self) -> dict[str, Array]:
        return {name: x for name, x in vars(self).items() if x is not None}


Samples: TypeAlias = Measurements | Iterable[Measurements]


def pieces(measurements: Samples) -> Iterator[Measurements]:
    """Pieces of measurements; none spans two recordings."""
    for recording in [measurements] if isinstance(measurements, Measurements) else measurements:
        yield from (recording[i : i + SAMPLES_AT_ONCE] for i in range(0, len(recording), SAMPLES_AT_ONCE))


def subsample(samples: Sequence[Measurements], most: int) -> Measurements:
    """Every k-th sample of recordings in one, at most about so many."""
    stride = max(1, sum(map(len, samples)) // most)
    names = samples[0]._named()
    return Measurements(*(np.concatenate([getattr(x, name)[::stride] for x in samples]) for name in names))


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Uniform measurement noise proportional to the signal, x · (1 + level · U(−1, 1))."""

    level: NonNegative = 0.1  # 0.1 for the paper's "10 % uniform random noise"
    torque: bool = True  # whether measured torques are noisy
    state: bool = False  # whether measured positions, velocities and accelerations are noisy

    @property
    def exact(self) -> bool:
        """Whether nothing is noisy."""
        return not self.level or not (self.torque or self.state)


def exact_measurements(body: RigidBody, motion: Motion) -> Measurements:
    """Measurements, (B·T, J), without noise, of an arm that executes a motion (B, T, J) exactly.

    Raises:
        ShapeError: when the motion is empty, does not fit the arm or is not finite.
    """
    shape = motion.position.shape
    if not motion.position.size:
        raise ShapeError(f"motion is {tuple(shape)}: there is nothing to measure")
    q, dq, ddq = (x.reshape(-1, shape[-1]) for x in motion[1:])
    return Measurements(q, dq, ddq, body.torque(q, dq, ddq))


def add_noise(exact: Measurements, noise: Noise, random: np.random.Generator, batch: int = 1) -> Measurements:
    """Exact measurements of ``batch`` equally long trajectories, one after another, with noise added.

    The torque stays that of the true states. The draws do not depend on which signals are noisy, and a
    batch draws the same numbers as its trajectories in turn.
    """
    draws = random.uniform(-1.0, 1.0, (batch, 4, len(exact) // batch, exact.joints))
    draws = draws.swapaxes(0, 1).reshape(4, -1, exact.joints)
    each = zip((*exact.states, exact.torque), draws, (*[noise.state] * 3, noise.torque))
    return Measurements(*(x + noise.level * x * d if noisy else x for x, d, noisy in each))
