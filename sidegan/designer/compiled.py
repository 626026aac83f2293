"""The designer's arithmetic by compiled kernels."""

import numpy as np

from sidegan.design.objective import HIGHEST, LOWEST, SHARPNESS
from sidegan.design.problem import HOPELESS
from sidegan.designer.aim import Aim, Numbers
from sidegan.designer.descent import Grid, Penalties
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.kernels import descent, goals, plans, terms
from sidegan.kernels.limits import Limits
from sidegan.motion.arrays import array
from sidegan.motion.operations import columns_of_links

Array = np.ndarray

_KINDS = {
    "condition": goals.CONDITION,
    "diagonal": goals.DIAGONAL,
    "determinant": goals.DETERMINANT,
    "variance": goals.VARIANCE,
}
_SMOOTH = goals.Smooth(LOWEST, HIGHEST, SHARPNESS, HOPELESS)
_RULES = descent.Rules(step=0.3, armijo=1e-4, shrink=0.3, curvature=1e-10, shortest=1e-6)
_MEMORY = 25


class Descents:
    """Descents for one arm in its workspace; not to be shared among threads."""

    def __init__(self, numbers: ArmNumbers, grid: Grid) -> None:
        self.numbers, self.grid = numbers, grid
        body, arm = numbers.constraints.body, numbers.arm
        self._columns = columns_of_links(body.base.columns, body.joints)
        self._chain = body.chain
        self._parameters = array(arm.inertial_parameters.flatten())
        self._basis = numbers.basis(grid.samples, 3)
        self._fine = numbers.basis(grid.samples * grid.refine, 2 + len(numbers.limits))
        self._rooms: dict[tuple[int, int], plans.Room] = {}  # by parameters, and terms of joints among them

    def descent(self, scene: Scene, aim: Aim, penalties: Penalties) -> "Descent":
        """A descent in a scene."""
        plan = self._plan(scene, aim, penalties)
        size = len(plan.subspace), len(plan.extra.kinds)
        if size not in self._rooms:
            self._rooms[size] = plans.room(plan)
        joints, functions = scene.size.shape
        return Descent(self, plan, self._rooms[size], descent.search(joints, functions, _MEMORY))

    def _plan(self, scene: Scene, aim: Aim, penalties: Penalties) -> plans.Plan:
        numbers, joints = self.numbers, len(scene.home)
        wanted, amount = aim.numbers(numbers.constraints.body), self.grid.rate * scene.period
        kind = goals.VOLUME if aim.kind == "determinant" and aim.interest is not None else _KINDS[aim.kind]
        goal = goals.Goal(kind, _SMOOTH, wanted.prior, amount, wanted.targets)
        free = np.full(joints, np.inf)
        middle, room = (numbers.upper + numbers.lower) / 2, (numbers.upper - numbers.lower) / 2
        bounds = Limits(0.0, 0.0, 0.0, middle, room, scene.speed, free, self._parameters)
        torques = Limits(0.0, 0.0, 0.0, middle, free, free, scene.torque, self._parameters)
        plan = plans.Plan(
            self._chain, scene.shapes, self._columns, _terms(aim, wanted, joints), wanted.subspace,
            scene.home, numbers.turn, scene.size, numbers.stretched(self._basis, scene.period),
            numbers.stretched(self._fine, scene.period), torques, bounds, numbers.limits, 0.0, 0.0,
            aim.roots_of(joints), goal,
        )  # fmt: skip
        return self.penalised(plan, penalties)

    def penalised(self, plan: plans.Plan, penalties: Penalties) -> plans.Plan:
        """The same plan with other penalties."""
        samples, finer = self.grid.samples, self.grid.samples * self.grid.refine
        weight = penalties.weight if np.isfinite(plan.torques.torque).any() else 0.0
        bounds = plan.bounds._replace(weight=penalties.weight / finer, reserve=penalties.reserve)
        return plan._replace(
            torques=plan.torques._replace(weight=weight / samples, torque_reserve=penalties.torque),
            bounds=bounds,
            close=penalties.close / finer,
            reach=penalties.reach,
        )


class Descent:
    """L-BFGS on one scene."""

    def __init__(self, owner: Descents, plan: plans.Plan, room: plans.Room, state: descent.Search) -> None:
        self._owner, self._plan, self._room, self._state = owner, plan, room, state

    def penalise(self, penalties: Penalties) -> None:
        """Go on with other penalties."""
        self._plan = self._owner.penalised(self._plan, penalties)
        self._state.numbers[descent.STARTED] = 0.0

    def place(self, x: Array) -> None:
        """Begin at a point (J, K)."""
        self._state.x[:] = x
        self._state.numbers[descent.STARTED] = 0.0

    def run(self, evaluations: int) -> None:
        """So many evaluations."""
        descent.descend(self._plan, _RULES, self._state, self._room, evaluations)

    def evaluate(self, x: Array, gradient: Array) -> tuple[float, float]:
        """Goal and penalty of a point (J, K); writes the gradient of their sum."""
        return plans.objective(self._plan, np.ascontiguousarray(x), gradient, self._room)

    @property
    def x(self) -> Array:
        """Where it is, (J, K)."""
        return self._state.x.copy()

    @property
    def goal(self) -> float:
        """The goal there."""
        return float(self._state.numbers[descent.GOAL])

    @property
    def cost(self) -> float:
        """The penalty there."""
        return float(self._state.numbers[descent.COST])

    @property
    def coefficients(self) -> Array:
        """Coefficients (J, K) [rad/s] there."""
        return (self._state.x * self._plan.size) @ self._plan.turn.T


def _terms(aim: Aim, wanted: Numbers, joints: int) -> terms.JointTerms:
    """What the aim's model has beside rigid bodies."""
    speeds = np.ones(joints)
    if aim.model is None:
        return terms.JointTerms(np.zeros(0, np.int64), np.zeros(joints + 1, np.int64), 1.0, speeds)
    if aim.model.stribeck is not None:
        speeds = array(aim.model.stribeck)
    known = aim.model.terms
    kinds = np.array([terms.KINDS.index(known.kinds[k]) for k in wanted.terms[:, 1]], np.int64)
    first = np.searchsorted(wanted.terms[:, 0], np.arange(joints + 1))
    return terms.JointTerms(kinds, first, known.sign_width, speeds)
