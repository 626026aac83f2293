"""Samples of joint states and torques, recorded or simulated with noise."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.trajectory import Motion

if TYPE_CHECKING:
    from sidegan.motion.dynamics import RigidBody

STATES_AT_ONCE = 16_384  # inverse dynamics of that many states of a 7-joint arm stay under 100 MB


@dataclass(frozen=True, eq=False)
class Measurements:
    """S samples of a J-joint arm, (S, J) each.

    Attributes:
        position: [rad or m].
        velocity: [rad/s or m/s].
        acceleration: [rad/s² or m/s²].
        torque: [N·m or N].
        sign: smooth sign of the velocity after the low-pass that torque went through, for Coulomb friction: a
            sign that jumps does not explain a torque that cannot. None takes it from the velocity.

    Raises:
        ShapeError: when they are not alike, not (S, J), or not finite.
    """

    position: Tensor
    velocity: Tensor
    acceleration: Tensor
    torque: Tensor
    sign: Tensor | None = None

    def __post_init__(self) -> None:
        for name, x in self._named():
            if x.ndim != 2 or x.shape != self.torque.shape:
                raise ShapeError(
                    f"{name} is {tuple(x.shape)}, expected (S, J) like torque {tuple(self.torque.shape)}"
                )
            bad = ~x.isfinite().all(1)
            if bad.any():
                raise ShapeError(f"{name} of sample {int(bad.nonzero()[0])} is not finite")

    def __len__(self) -> int:
        return len(self.torque)

    def __getitem__(self, samples: slice) -> "Measurements":
        return Measurements(*(x[samples] for _, x in self._named()))

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.torque.shape[1]

    @property
    def states(self) -> tuple[Tensor, Tensor, Tensor]:
        """Position, velocity and acceleration."""
        return self.position, self.velocity, self.acceleration

    @property
    def inputs(self) -> tuple[Tensor, ...]:
        """What a model's regressor is of: the states, and the sign where there is one."""
        return self.states if self.sign is None else (*self.states, self.sign)

    def copy(self) -> "Measurements":
        """The same in memory of their own, so that what they were cut from can go."""
        return Measurements(*(x.clone() for _, x in self._named()))

    def append(self, other: "Measurements") -> "Measurements":
        """These samples followed by ``other``'s."""
        if self.joints != other.joints:
            raise ShapeError(f"measurements of {self.joints} and of {other.joints} joints cannot be joined")
        if (self.sign is None) != (other.sign is None):
            raise ShapeError("measurements with and without a sign cannot be joined")
        return Measurements(*(torch.cat([x, y]) for (_, x), (_, y) in zip(self._named(), other._named())))

    def _named(self) -> list[tuple[str, Tensor]]:
        named = [(field.name, getattr(self, field.name)) for field in fields(self)]
        return [(name, x) for name, x in named if x is not None]


def chunks(measurements: Measurements | Iterable[Measurements], samples: int) -> Iterator[Measurements]:
    """The same samples in pieces of ``samples``, the last one shorter, however long each recording is."""
    if samples < 1:
        raise ConfigError(f"samples at once must be at least 1, got {samples}")
    rest: Measurements | None = None
    for part in [measurements] if isinstance(measurements, Measurements) else measurements:
        rest = part if rest is None else rest.append(part)
        whole = len(rest) // samples * samples
        yield from (rest[i : i + samples] for i in range(0, whole, samples))
        rest = rest[whole:]
    if rest is not None and len(rest):
        yield rest


@dataclass(frozen=True)
class Noise:
    """Uniform measurement noise.

    ``multiplicative`` is x · (1 + level · U(−1, 1)); ``additive`` is x + level · σ · U(−1, 1) with σ
    the standard deviation of that joint's signal over its trajectory.

    Args:
        kind: ``"multiplicative"`` or ``"additive"``.
        level: 0.1 for the paper's "10 % uniform random noise".
        torque: whether measured torques are noisy.
        state: whether measured positions, velocities and accelerations are noisy.

    Raises:
        ConfigError: when the kind is unknown or the level is not a finite number ≥ 0.
    """

    kind: str = "multiplicative"
    level: float = 0.1
    torque: bool = True
    state: bool = False

    def __post_init__(self) -> None:
        if self.kind not in ("multiplicative", "additive"):
            raise ConfigError(f"noise kind is {self.kind!r}, expected 'multiplicative' or 'additive'")
        if not (math.isfinite(self.level) and self.level >= 0):
            raise ConfigError(f"noise level is {self.level}, expected a finite number ≥ 0")

    def add(self, x: Tensor, draw: Tensor) -> Tensor:
        """Noisy signals (B, T, J) from clean ones and a draw of U(−1, 1)."""
        scale = x if self.kind == "multiplicative" else x.std(1, correction=0, keepdim=True)
        return x + self.level * scale * draw


def measure(body: "RigidBody", motion: Motion, noise: Noise, generator: np.random.Generator) -> Measurements:
    """Simulated measurements, (B·T, J), of an arm that executes a motion (B, T, J) exactly.

    The torque is that of the true states. Both kinds of noise and all choices of what is noisy use
    the same draws, and a batch those of its trajectories in turn, so comparisons differ in nothing else.

    Args:
        body: the arm's true dynamics.
        motion: states on a time grid.
        noise: what is added to the states and torques.
        generator: source of the noise.

    Raises:
        ShapeError: when the motion does not fit the arm or is not finite.
    """
    states = motion[1:]
    if not motion.position.numel():
        raise ShapeError(f"motion is {tuple(motion.position.shape)}: there is nothing to measure")
    flat = [x.flatten(0, 1) for x in states]
    parts = zip(*(x.split(STATES_AT_ONCE) for x in flat))
    torque = torch.cat([body.torque(*part) for part in parts]).reshape(motion.position.shape)
    batch, count, joints = torque.shape
    draw = torch.from_numpy(generator.uniform(-1.0, 1.0, (batch, 4, count, joints))).to(torque)
    signals = (*states, torque)
    noisy = (noise.state, noise.state, noise.state, noise.torque)
    measured = [noise.add(x, draw[:, i]) if noisy[i] else x for i, x in enumerate(signals)]
    return Measurements(*(x.flatten(0, 1) for x in measured))
