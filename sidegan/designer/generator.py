"""A generator of starts: a situation in, trajectories out that need little polish, or none."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.designer.arrays import read_arrays, write_arrays
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.designer.starts import FAR, NEAR, PROBES, effort_of
from sidegan.errors import ArtifactError

Array = np.ndarray

_FORMAT = "generator 1"
_FULL = 0.97  # of its limits that a joint uses at most
_SPREAD = 2.0  # of log shares of limits and log periods


@dataclass(frozen=True, eq=False)
class Generator:
    """M trajectories for any situation: those of the plain one, each moved by a network.

    The network sees where home is within its limits, the effort and the period, how far the probes are from
    regions, and which of the M it moves. Points are in natural coordinates, which scale with the situation.
    """

    modes: Array  # points of the plain situation, the best on the whole first, (M, J K)
    # weights (outputs, inputs) and biases of the layers: the first sees situation and mode, the last gives
    # the way from the mode, those between are added to what they see
    layers: tuple[tuple[Array, Array], ...]

    def __len__(self) -> int:
        return len(self.modes)

    def candidates(self, numbers: ArmNumbers, scene: Scene, felt: Array, count: int) -> list[Array]:
        """Coefficients (J, K) [rad/s] of so many trajectories, within the limits of a scene."""
        points = self.points(features(numbers, scene, felt), np.arange(min(count, len(self))))
        joints, functions = scene.size.shape
        c = (points.reshape(-1, joints, functions) * scene.size) @ numbers.turn.T
        return list(numbers.within(scene, c, _FULL))

    def points(self, seen: Array, modes: Array) -> Array:
        """Points (B, J K) of some modes in one situation."""
        (first, bias), *inner, (last, shift) = self.layers
        hidden = first[:, : len(seen)] @ seen + bias
        x = _silu(hidden + first[:, len(seen) + modes].T)
        for weight, between in inner:
            x = x + _silu(x @ weight.T + between)
        return self.modes[modes] + x @ last.T + shift

    def save(self, path: Path, numbers: ArmNumbers) -> None:
        """Write one file of numbers."""
        arrays = {"modes": self.modes}
        for k, (weight, bias) in enumerate(self.layers):
            arrays |= {f"weight{k}": weight, f"bias{k}": bias}
        write_arrays(path, _meta(numbers), arrays)

    @classmethod
    def load(cls, path: Path, numbers: ArmNumbers) -> "Generator":
        """Generator of a file that ``save`` wrote, for the same arm in the same workspace.

        Raises:
            ArtifactError: for a truncated or foreign file, or another arm.
        """
        arrays = read_arrays(path, _meta(numbers), "a generator")
        try:
            modes, count = arrays["modes"], (len(arrays) - 1) // 2
            layers = tuple((arrays[f"weight{k}"], arrays[f"bias{k}"]) for k in range(count))
        except KeyError as error:
            raise ArtifactError(f"{path} does not hold a generator: {error}") from error
        joints, harmonics, _ = numbers.trajectory.shape
        ends = seen_by(joints) + len(modes), 2 * joints * harmonics
        if modes.shape[1:] != ends[1:] or not _fit(layers, ends):
            raise ArtifactError(f"{path} contradicts itself: its numbers do not fit each other")
        return cls(modes, layers)


def _fit(layers: Sequence[tuple[Array, Array]], ends: tuple[int, int]) -> bool:
    """Whether layers fit each other, and from how many inputs to how many outputs they lead."""
    sizes = [weight.shape for weight, _ in layers]
    if len(layers) < 2 or any(len(size) != 2 for size in sizes):
        return False
    chained = all(one[0] == other[1] for one, other in pairwise(sizes))
    biased = all(bias.shape == weight.shape[:1] for weight, bias in layers)
    return chained and biased and (sizes[0][1], sizes[-1][0]) == ends


def _meta(numbers: ArmNumbers) -> dict[str, Any]:
    arm, family = numbers.arm, numbers.trajectory
    meta = {"format": _FORMAT, "robot": arm.name, "digest": arm.digest, "harmonics": family.harmonics}
    return {**meta, "period": family.period, "home": list(family.home or ())}


def seen_by(joints: int) -> int:
    """How many numbers a network sees of a situation."""
    return joints + 3 + PROBES


def features(numbers: ArmNumbers, scene: Scene, felt: Array) -> Array:
    """What a network sees of a situation, ``seen_by(J)`` numbers."""
    half = (numbers.upper - numbers.lower) / 2
    home = (scene.home - (numbers.upper + numbers.lower) / 2) / half
    usual = np.array([0.0, 0.0, np.log(numbers.trajectory.period)])
    assert len(felt) == PROBES  # of the same probes
    return np.concatenate(
        [home, _SPREAD * (effort_of(scene) - usual), (2 * felt - NEAR - FAR) / (FAR - NEAR)]
    )


def _silu(x: Array) -> Array:
    return x / (1 + np.exp(-np.clip(x, -60, 60)))
