"""Trajectories to start from: a small library that is made once for an arm in its workspace."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from sidegan.designer.arrays import read_arrays, write_arrays
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.errors import ArtifactError
from sidegan.validity import Box, Plane, Region

Array = np.ndarray

_FORMAT = 1
PROBES = 64  # points of the workspace at which regions are felt
NEAR, FAR = -0.1, 0.3  # [m] distances from regions beyond which they are all alike
_EFFORT, _WORTH = 0.2, 0.1  # how much effort and period, and what was reached, count beside homes and regions
_ARRAYS = ("home", "felt", "effort", "coefficients", "goal")


@dataclass(frozen=True, eq=False)
class Starts:
    """Trajectories of N situations."""

    home: Array  # (N, J) [rad or m]
    felt: Array  # distances of the probes from the regions [m], (N, PROBES)
    effort: Array  # log shares of velocity and torque limits, and log period [s], (N, 3)
    coefficients: Array  # (N, J, K) [rad/s]
    goal: Array  # log condition number that was reached, (N,)

    def __len__(self) -> int:
        return len(self.home)

    def nearest(self, scene: Scene, felt: Array, count: int) -> Array:
        """Which of them come from situations most like a scene, the most like first."""
        scale = (scene.above + scene.below) / 2
        apart = np.square((self.home - scene.home) / scale).sum(1)
        apart = apart + np.square((self.felt - felt) / FAR).mean(1)
        apart = apart + _EFFORT * np.square(self.effort - effort_of(scene)).sum(1) + _WORTH * self.goal
        return np.argsort(apart, kind="stable")[:count]

    def candidates(self, numbers: ArmNumbers, scene: Scene, felt: Array, count: int) -> list[Array]:
        """Coefficients (J, K) [rad/s] of so many of them, adapted to a scene."""
        return [self.adapted(numbers, scene, int(k)) for k in self.nearest(scene, felt, count)]

    def adapted(self, numbers: ArmNumbers, scene: Scene, index: int) -> Array:
        """Coefficients (J, K) [rad/s] of one of them, as fast as a scene allows, within its limits."""
        factor = np.exp(effort_of(scene)[0] - self.effort[index, 0])
        return numbers.within(scene, self.coefficients[index] * factor, _SHARE)

    def save(self, path: Path, numbers: ArmNumbers) -> None:
        """Write one file of numbers."""
        write_arrays(path, _meta(numbers), {name: getattr(self, name) for name in _ARRAYS})

    @classmethod
    def load(cls, path: Path, numbers: ArmNumbers) -> "Starts":
        """Starts of a file that ``save`` wrote, for the same arm and harmonics.

        Raises:
            ArtifactError: for a truncated or foreign file, or another arm.
        """
        arrays = read_arrays(path, _meta(numbers), "starts")
        if set(arrays) != set(_ARRAYS):
            raise ArtifactError(f"{path} does not hold starts: it has {sorted(arrays)}")
        starts = cls(**arrays)
        joints, harmonics, _ = numbers.trajectory.shape
        shapes = [x.shape for x in (starts.home, starts.felt, starts.effort, starts.coefficients)]
        count = len(starts.goal)
        if shapes != [(count, joints), (count, PROBES), (count, 3), (count, joints, 2 * harmonics)]:
            raise ArtifactError(f"{path} contradicts itself: its numbers do not fit each other")
        return starts


_SHARE = 0.97  # of its limits that a joint of a start uses at most


def _meta(numbers: ArmNumbers) -> dict[str, Any]:
    arm = numbers.arm
    harmonics = numbers.trajectory.harmonics
    return {"format": _FORMAT, "robot": arm.name, "digest": arm.digest, "harmonics": harmonics}


def effort_of(scene: Scene) -> Array:
    """Log shares of velocity and torque limits, and log period [s], (3,)."""
    situation = scene.situation
    return np.log([situation.velocity, situation.torque, scene.period])


class Probes:
    """Points of the workspace at which regions are felt."""

    def __init__(self, numbers: ArmNumbers) -> None:
        ends = numbers.ends
        middles = ends.mean(0)[len(numbers.moving) // 2 :].reshape(-1, 3)  # of the outer links
        self.points = middles[:: max(1, len(middles) // PROBES)][:PROBES]
        if len(self.points) < PROBES:  # an arm without shapes feels nothing
            self.points = np.zeros((PROBES, 3))
        self.radius = float(np.linalg.norm(self.points, axis=1).max())

    def feel(self, regions: Sequence[Region]) -> Array:
        """Smallest distance of each from regions, between bounds [m], (PROBES,)."""
        felt = np.full(len(self.points), FAR)
        for region in regions:
            felt = np.minimum(felt, self._distance(region))
        return felt.clip(NEAR, FAR)

    def _distance(self, region: Region) -> Array:
        """Distance of each from a region [m], (PROBES,)."""
        if isinstance(region, Plane):
            return self.points @ np.array(region.unit) - region.offset
        if not isinstance(region, Box):
            points = torch.from_numpy(self.points).T
            return region.margin(points, points).numpy()
        numbers = np.array(region.numbers)
        beyond = np.abs(self.points - numbers[:3]) - numbers[3:]
        return np.sqrt(np.square(beyond.clip(0)).sum(1)) + beyond.max(1).clip(max=0)

    def draw(self, random: np.random.Generator) -> list[Region]:
        """One or two regions at random: walls beside the arm, a higher floor, boxes within its reach."""
        regions: list[Region] = []
        for kind in random.choice(3, size=random.integers(1, 3), replace=False):
            if kind == 0:
                regions += self._walls(random)
            elif kind == 1:
                regions.append(Plane((0.0, 0.0, 1.0), float(random.uniform(0.0, 0.25) * self.radius)))
            else:
                centre = self.points[random.integers(len(self.points))]
                half = random.uniform(0.05, 0.15, 3) * self.radius
                low, high = (tuple((centre + s * half).tolist()) for s in (-1, 1))
                regions.append(Box(low, high))
        return regions

    def _walls(self, random: np.random.Generator) -> list[Region]:
        away = [float(x) for x in -random.uniform(0.4, 1.0, 2) * self.radius]
        normals = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]
        return [Plane(normal, away[k // 2]) for k, normal in enumerate(normals)]
