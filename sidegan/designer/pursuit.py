"""How a budget is spent: which start is pursued for how long, and when what was found is proven."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sidegan.designer.descent import Penalties
from sidegan.designer.proof import NEAR_MARGINS, Prover, Verdict
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.designer.settings import DesignerSettings

if TYPE_CHECKING:
    from sidegan.designer.compiled import Descent

Array = np.ndarray

_WEIGHT = 300.0  # of violations
_CHUNK = 6  # evaluations between two looks at the clock
_CHECKPOINTS = (12, 24, 48, 80, 140, 200, 300, 500)  # evaluations of a pursuit after which it is proven
_FULL = 0.99  # share of its limits that a joint uses at most
_REACH = 0.7  # that a joint of a random start uses
_FIRST = 3  # proofs that have their time before there is an answer
_MEND, _MENDED = 8, 2  # evaluations with more in reserve where a proof fails, and how often
_MORE = 0.01  # share of limits, and [m] of clearance, that is reserved besides what was lacking
_SHRINK = (0.95, 0.88, 0.78, 0.65, 0.5, 0.35, 0.2, 0.1, 0.05, 0.02)  # towards home, where nothing else helps
_LITTLE = 0.004  # share of limits, and [m], within which a smaller motion is not worth a proof
_HALF = 0.5  # of what home has, where that is less
_ALIKE = 0.01  # share by which coefficients may differ that have one goal
_BETTER = 1e-3  # by which a goal must be better to be worth a proof


@dataclass
class Pace:
    """How long things take here, as far as is known [s]."""

    evaluation: float = 4e-4
    proof: float = 1.5e-3


class Budget:
    """Evaluations and time that are left."""

    def __init__(
        self, clock: Callable[[], float], pace: "Pace", evaluations: int | None, deadline: float | None
    ) -> None:
        self._clock, self._began = clock, clock()
        self._most, self._deadline, self._pace = evaluations, deadline, pace
        self.evaluations = self.proofs = 0
        self.looks = 0  # evaluations that no budget limits: of what is made smaller

    @property
    def seconds(self) -> float:
        """What was spent [s]."""
        return self._clock() - self._began

    def left(self, proofs: int = 0) -> int:
        """Evaluations that are left when so many proofs have their time."""
        many = 10**9 if self._most is None else self._most - self.evaluations
        if self._deadline is not None:
            rest = self._deadline - self.seconds - proofs * self._pace.proof
            many = min(many, int(rest / self._pace.evaluation))
        return max(0, many)

    @property
    def late(self) -> bool:
        """Whether there is no time for another proof."""
        return self._deadline is not None and self.seconds + self._pace.proof > self._deadline

    def evaluated(self, count: int, seconds: float) -> None:
        """Take note of evaluations."""
        self.evaluations += count
        self._pace.evaluation += 0.2 * (seconds / max(1, count) - self._pace.evaluation)

    def proven(self, seconds: float) -> None:
        """Take note of a proof."""
        self.proofs += 1
        self._pace.proof += 0.2 * (seconds - self._pace.proof)

    def time(self) -> float:
        """What the clock says [s]."""
        return self._clock()


class Pursuit:
    """The search for one answer."""

    def __init__(
        self,
        numbers: ArmNumbers,
        settings: DesignerSettings,
        prover: Prover,
        scene: Scene,
        at_home: Verdict,
        budget: Budget,
        random: np.random.Generator,
    ) -> None:
        self._numbers, self._settings, self._prover = numbers, settings, prover
        self._scene, self._at_home, self._budget, self._random = scene, at_home, budget, random
        self._gradient = np.zeros_like(scene.size)
        self.best: Array | None = None
        self.verdict: Verdict | None = None
        self.goal = np.inf
        self._penalties = self.penalties
        self._last: Verdict | None = None

    @property
    def penalties(self) -> Penalties:
        """What a search begins with."""
        settings = self._settings
        return Penalties(_WEIGHT, settings.reserve, settings.reserve, settings.clearance)

    def run(self, descent: "Descent") -> tuple[Array | None, Verdict | None]:
        """The best proven coefficients (J, K) [rad/s], and the verdict on them or on the last that failed."""
        while self._left > 0 and not self._budget.late:
            self._penalties = self.penalties
            descent.penalise(self._penalties)
            descent.place(self._start())
            self._pursue(descent)
        return self.best, self.verdict

    @property
    def _left(self) -> int:
        """Evaluations that are left when what they find shall be proven, or made smaller until it is."""
        return self._budget.left(_FIRST if self.best is None else 1)

    def _look(self, descent: "Descent", c: Array) -> tuple[float, float]:
        """Goal and penalty of coefficients (J, K) [rad/s] beside the search."""
        self._budget.looks += 1
        return descent.evaluate(self._numbers.points(self._scene, c), self._gradient)

    def _start(self) -> Array:
        """A random point."""
        return self._numbers.start(self._scene, self._random, _REACH)

    def _pursue(self, descent: "Descent") -> None:
        """Descend from one start, and prove what comes of it every now and then."""
        done = 0
        patience = self._settings.patience
        for checkpoint in [*(x for x in _CHECKPOINTS if x < patience), patience]:
            while done < checkpoint:
                count = min(_CHUNK, checkpoint - done, self._left)
                if count == 0:
                    break
                self._descend(descent, count)
                done += count
            last = self._left == 0
            self._settle(descent, mend=last or checkpoint == patience)
            if last or self._budget.late:
                return

    def _descend(self, descent: "Descent", count: int) -> None:
        began = self._budget.time()
        descent.run(count)
        self._budget.evaluated(count, self._budget.time() - began)

    def _settle(self, descent: "Descent", mend: bool) -> None:
        """Take what a descent has found where it is better and proven, after mending or shrinking."""
        if self._offer(descent) or (self.best is not None and not mend):
            return
        for _ in range(_MENDED):
            if self._budget.left(2) < _MEND:
                break
            descent.penalise(self._stricter())
            self._descend(descent, _MEND)
            if self._offer(descent):
                return
        if self.best is None:
            self._shrink(descent)

    def _shrink(self, descent: "Descent") -> None:
        """Take what a descent has found closer to home until it is proven."""
        c = self._numbers.within(self._scene, descent.coefficients, _FULL)
        descent.penalise(self._bare)
        for share in _SHRINK:
            if self._budget.late:
                break
            goal, cost = self._look(descent, share * c)
            if cost == 0 and self._take(share * c, goal):
                break
        descent.penalise(self._penalties)

    @property
    def _bare(self) -> Penalties:
        """Penalties without any reserve but a little, and no more than home itself has."""
        numbers, home = self._numbers, self._at_home
        room = (numbers.upper - numbers.lower) / 2
        whole = np.array([room[home.elements[0]], self._scene.torque[home.elements[2]]])
        reserve, torque = np.minimum(_LITTLE, _HALF * home.margins[[0, 2]] / whole)
        reach = min(_LITTLE, _HALF * float(home.margins[NEAR_MARGINS].min()))
        return replace(self.penalties, reserve=float(reserve), torque=float(torque), reach=reach)

    def _offer(self, descent: "Descent") -> bool:
        """Take what a descent has found, within the limits; whether there is nothing left to be done."""
        found = descent.coefficients
        c, goal = self._numbers.within(self._scene, found, _FULL), descent.goal
        if np.abs(found - c).max() > _ALIKE * np.abs(c).max():
            goal = self._look(descent, c)[0]
        return self._take(c, goal)

    def _take(self, c: Array, goal: float) -> bool:
        """Prove coefficients that are better than the best; whether there is nothing left to be done."""
        if not goal < self.goal - _BETTER:
            return True
        began = self._budget.time()
        verdict = self._prover.prove(self._scene, c)
        self._budget.proven(self._budget.time() - began)
        if verdict.valid:
            self.best, self.goal = c, goal
        if verdict.valid or self.best is None:
            self.verdict = verdict
        self._last = verdict
        return verdict.valid

    def _stricter(self) -> Penalties:
        """Penalties with more in reserve of what the last proof found lacking."""
        assert self._last is not None  # a proof has failed
        lack = np.maximum(-self._last.margins, 0.0)
        before, joint = self._penalties, self._last.elements[2]
        torque = before.torque + (lack[2] / self._scene.torque[joint] + _MORE if lack[2] > 0 else 0.0)
        apart = max(lack[3], lack[4])
        reach = before.reach + (apart + _MORE if apart > 0 else 0.0)
        self._penalties = Penalties(2 * before.weight, before.reserve + _MORE, torque, reach)
        return self._penalties
