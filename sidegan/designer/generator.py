"""A generator of starts: a situation in, trajectories out that need little polish, or none."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch

from sidegan.base.storage import read_torch, write_torch
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
        tensors = {"modes": torch.from_numpy(self.modes)}
        for k, (weight, bias) in enumerate(self.layers):
            tensors |= {f"weight{k}": torch.from_numpy(weight), f"bias{k}": torch.from_numpy(bias)}
        write_torch(path, {"meta": json.dumps(_meta(numbers)), **tensors})

    @classmethod
    def load(cls, path: Path, numbers: ArmNumbers) -> "Generator":
        """Generator of a file that ``save`` wrote, for the same arm in the same workspace.

        Raises:
            ArtifactError: for a truncated or foreign file, or another arm.
        """
        content = read_torch(path)
        try:
            meta, expected = json.loads(content.pop("meta")), _meta(numbers)
            arrays = {name: tensor.numpy() for name, tensor in content.items()}
            modes, count = arrays["modes"], (len(arrays) - 1) // 2
            layers = tuple((arrays[f"weight{k}"], arrays[f"bias{k}"]) for k in range(count))
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise ArtifactError(f"{path} does not hold a generator: {error}") from error
        if meta != expected:
            raise ArtifactError(f"{path} holds a generator of {meta}, expected {expected}")
        _refuse_misfits(path, modes, layers)
        return cls(modes, layers)


def _refuse_misfits(path: Path, modes: Array, layers: Sequence[tuple[Array, Array]]) -> None:
    """Refuse layers that do not fit each other."""
    sizes = [weight.shape for weight, _ in layers]
    chained = all(one[0] == other[1] for one, other in pairwise(sizes))
    biased = all(weight.shape[0] == len(bias) for weight, bias in layers)
    if len(layers) < 2 or not (chained and biased) or sizes[-1][0] != modes.shape[1]:
        raise ArtifactError(f"{path} contradicts itself: its numbers do not fit each other")


def _meta(numbers: ArmNumbers) -> dict[str, Any]:
    arm, family = numbers.arm, numbers.trajectory
    meta = {"format": _FORMAT, "robot": arm.name, "digest": arm.digest, "harmonics": family.harmonics}
    return {**meta, "period": family.period, "home": list(family.home or ())}


def features(numbers: ArmNumbers, scene: Scene, felt: Array) -> Array:
    """What a network sees of a situation, (J + 3 + PROBES,)."""
    half = (numbers.upper - numbers.lower) / 2
    home = (scene.home - (numbers.upper + numbers.lower) / 2) / half
    usual = np.array([0.0, 0.0, np.log(numbers.trajectory.period)])
    assert len(felt) == PROBES  # of the same probes
    return np.concatenate(
        [home, _SPREAD * (effort_of(scene) - usual), (2 * felt - NEAR - FAR) / (FAR - NEAR)]
    )


def _silu(x: Array) -> Array:
    return x / (1 + np.exp(-np.clip(x, -60, 60)))
