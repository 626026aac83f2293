"""The proof that one trajectory keeps every constraint over its whole period, without overhead.

It is ``sidegan.validity.check``, cell by cell: the same kernel, the same cells.
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.motion.arrays import array
from sidegan.validity.bounds import COARSE, LEVELS, ORDERS, SPLIT
from sidegan.validity.constraints import NAMES, Constraints

Array = np.ndarray

_KEPT = 64  # grids of cells: a few megabytes

NEAR_MARGINS = [NAMES.index(name) for name in ("collision", "keep_out")]


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a proof found: of every constraint the smallest margin, where and when it is."""

    margins: Array  # [rad, rad/s, N·m, m, rad/s², rad/s³], (7,); infinite where there is no such constraint
    elements: Array  # joint, pair or guarded capsule, (7,)
    times: Array  # [s], (7,)

    @property
    def valid(self) -> bool:
        """Whether everything provably holds."""
        return bool((self.margins >= 0).all())


class Prover:
    """Proofs of single trajectories by the check's own kernel."""

    def __init__(self, numbers: ArmNumbers) -> None:
        from sidegan.kernels import cells, validity
        from sidegan.kernels.waves import waves
        from sidegan.validity.search import model_of

        self.numbers, self._cells, self._kernel, self._waves = numbers, cells, validity, waves
        self._model_of = model_of
        self._models: WeakKeyDictionary[Constraints, cells.Model] = WeakKeyDictionary()
        self._model = self._base(numbers.constraints.clearance)
        self._work = cells.work_space(self._model)
        self._scene: Scene | None = None
        self._peaks = [array(numbers.unit.derivative_bound(order)).reshape(-1) for order in (4, 5)]
        self._grids: dict[int, Array] = {}

    def _base(self, clearance: float) -> "cells.Model":  # type: ignore[name-defined]  # noqa: F821
        known = self.numbers.constraints if self.numbers.same_pairs else self.numbers.keeping(clearance)
        if known not in self._models:
            self._models[known] = self._model_of(known)
        return self._models[known]

    def model(self, scene: Scene) -> "cells.Model":  # type: ignore[name-defined]  # noqa: F821
        """The scene as the kernel takes it."""
        reach = self.numbers.reach[scene.shapes.guarded[:, 1]]
        most = reach.max(0, keepdims=True) if len(reach) else np.zeros((1, len(scene.home)))
        return self._base(scene.clearance)._replace(
            shapes=scene.shapes,
            home=scene.home,
            speed=scene.speed,
            torque=scene.torque,
            region_reach=reach,
            region_most=most,
        )

    def prove(self, scene: Scene, c: Array) -> Verdict:
        """Whether coefficients (J, K) [rad/s] are valid."""
        if self._scene is not scene:
            self._scene, self._model = scene, self.model(scene)
        model, period = self._model, scene.period
        count, sampled = int(-(-period // COARSE)), max(2, int(period / COARSE))
        count = count if c.any() else 1  # an arm that rests does so in a single cell
        drifts = np.stack([np.abs(c) @ peaks for peaks in self._peaks]) / period ** np.array([[3.0], [4.0]])
        jerk = np.abs(c @ self._grid(sampled)[:, 3].T).max(1) / period**2 + drifts[0] * (period / sampled / 2)
        orders = period ** (1.0 - np.arange(ORDERS))[:, None]
        shape = 1, len(NAMES)
        smallest = self._kernel.Smallest(np.full(shape, np.inf), np.zeros(shape, int), np.zeros(shape))
        index, basis = np.arange(count), self._grid(count)
        asked = self._kernel.everything(model, count)
        for level in range(LEVELS):
            half = period / count / 2
            times = (index + 0.5) * (2 * half)
            motions = self._cells.Motions(c[None], jerk[None], drifts[:, None], basis * orders, times, half)
            undecided = np.empty(asked.shape, bool)
            which = np.zeros(len(index), int)
            last = level == LEVELS - 1
            cells = self._kernel.Cells(which, np.arange(len(index)), last, asked, undecided)
            self._kernel.visit(model, self._work, motions, cells, smallest)
            open_ = undecided.any(1)
            left, asked = index[open_], undecided[open_].repeat(SPLIT, 0)
            if last or not len(left) or not (smallest.margin[0] >= 0).all():
                break
            index = (left[:, None] * SPLIT + np.arange(SPLIT)).reshape(-1)
            count *= SPLIT
            basis = self._basis((index + 0.5) / count)
        return Verdict(*(x[0] for x in smallest))

    def _grid(self, count: int) -> Array:
        """Derivatives at the centres of so many cells, (count, 5, K)."""
        if count not in self._grids:
            if len(self._grids) >= _KEPT:
                self._grids.clear()
            self._grids[count] = self._basis((np.arange(count) + 0.5) / count)
        return self._grids[count]

    def _basis(self, shares: Array) -> Array:
        """The same at shares of the period."""
        basis = np.empty((len(shares), ORDERS, len(self._peaks[0])))
        self._waves(shares, basis)
        return basis
