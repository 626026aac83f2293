"""Situations that nobody has seen: homes, efforts, periods, floors, walls and boxes at random."""

import numpy as np
import torch

from sidegan.design.problem import Problem
from sidegan.designer import Situation
from sidegan.designer.proof import Prover
from sidegan.designer.scene import ArmNumbers
from sidegan.errors import InfeasibleError
from sidegan.validity import Box, Plane, Region

# What situations request, as many of each; the last: each of all kinds in half of them.
KINDS = ("home", "effort", "period", "floor", "walls", "box")
MIXES: tuple[tuple[str, ...] | None, ...] = (
    ("home",), ("effort",), ("box",), ("floor", "walls"), ("home", "box"),
    ("home", "effort", "box"), ("home", "effort", "floor", "walls", "box"), None,
)  # fmt: skip

_HOME = 0.5  # [rad] around the usual home, each joint
_SPEED, _TORQUE = (0.3, 1.0), (0.4, 1.0)  # shares of the limits
_PERIOD = (8.0, 32.0)  # [s]
_FLOOR, _WALLS = (0.1, 0.24), (0.45, 0.95)  # [m] height; half-widths of a room around the base
_CENTRES, _HALF = ((-0.7, -0.7, 0.2), (0.7, 0.7, 0.9)), (0.05, 0.15)  # [m] of cubes
_APART, _FAR = 0.02, 0.1  # [m] that home keeps from itself and the floor, and from walls and cubes
_SEVERAL = (3, 5)  # boxes where there are several


class Draw:
    """Situations of one arm in its workspace, the same for a seed."""

    def __init__(self, problem: Problem, seed: int) -> None:
        self.numbers = ArmNumbers(problem.constraints, problem.trajectory)
        self.prover = Prover(self.numbers)
        self.random = np.random.default_rng(seed)

    def mixed(self, each: int) -> list[Situation]:
        """As many situations of every mix, whose home keeps its distance from everything."""
        return [self._clear(kinds) for kinds in MIXES for _ in range(each)]

    def several(self, count: int) -> list[Situation]:
        """Situations among three to five boxes, with walls in half of them."""
        found = []
        while len(found) < count:
            boxes = [self._box() for _ in range(self.random.integers(*_SEVERAL, endpoint=True))]
            walls = self._walls() if self.random.random() < 0.5 else []
            situation = Situation(self._home(), [*boxes, *walls], *self._effort())
            if self._at_ease(situation):
                found.append(situation)
        return found

    def _clear(self, kinds: tuple[str, ...] | None) -> Situation:
        while True:
            asked = kinds or tuple(kind for kind in KINDS if self.random.random() < 0.5)
            situation = self._any(asked)
            if self._at_ease(situation):
                return situation

    def _any(self, kinds: tuple[str, ...]) -> Situation:
        """A situation with what is requested, feasible or not."""
        regions: list[Region] = []
        if "floor" in kinds:
            regions.append(Plane((0.0, 0.0, 1.0), self._between(_FLOOR)))
        regions += self._walls() if "walls" in kinds else []
        regions += [self._box()] if "box" in kinds else []
        home = self._home() if "home" in kinds else None
        effort = self._effort() if "effort" in kinds else (1.0, 1.0)
        return Situation(home, regions, *effort, self._between(_PERIOD) if "period" in kinds else None)

    def _between(self, ends: tuple[float, float]) -> float:
        return float(self.random.uniform(*ends))

    def _home(self) -> list[float]:
        usual = np.array(self.numbers.trajectory.home)
        drawn = usual + self.random.uniform(-_HOME, _HOME, len(usual))
        return drawn.clip(self.numbers.lower, self.numbers.upper).tolist()

    def _effort(self) -> tuple[float, float]:
        return self._between(_SPEED), self._between(_TORQUE)

    def _walls(self) -> list[Region]:
        widths = self._between(_WALLS), self._between(_WALLS)
        normals = [((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0))]
        return [Plane(normal, -width) for width, both in zip(widths, normals) for normal in both]

    def _box(self) -> Box:
        centre, half = self.random.uniform(*_CENTRES), self._between(_HALF)
        low, high = (tuple((centre + sign * half).tolist()) for sign in (-1, 1))
        return Box(low, high)

    def _at_ease(self, situation: Situation) -> bool:
        """Whether the arm can rest at home, and keeps its distance there."""
        numbers = self.numbers
        try:
            scene = numbers.scene(situation)
        except InfeasibleError:
            return False
        if not self.prover.prove(scene, np.zeros_like(scene.size)).valid:
            return False
        constraints, own = numbers.among(scene), len(numbers.constraints.regions)
        found = constraints.clearances(torch.from_numpy(scene.home)[None])
        far = [_APART] * own + [_APART if _is_floor(x) else _FAR for x in situation.regions]
        least = torch.tensor(far)[constraints.guarded[:, 0]]
        return bool((found["collision"] >= _APART).all() and (found["keep_out"][0] >= least).all())


def _is_floor(region: Region) -> bool:
    return isinstance(region, Plane) and region.normal[2] > 0
