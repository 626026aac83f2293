"""Design goals of trajectories, penalised, with exact gradients by compiled kernels.

For an eigenpair (λ, v) of YᵀY, dλ = 2 (Y v)ᵀ d(Y v), and Y v is the torque of a robot with inertial
parameters v: the gradient of a function of a few eigenvalues costs a few inverse dynamics, and no derivative
of the regressor.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.design.problem import Problem
from sidegan.errors import ShapeError
from sidegan.kernels import descent, goals, information
from sidegan.kernels import objective as kernel
from sidegan.kernels.dynamics import PenaltyLimits
from sidegan.kernels.regressor import columns_of_links
from sidegan.motion.arrays import array
from sidegan.motion.dynamics import RigidBody, share
from sidegan.validity.constraints import CONSTRAINTS

_LEAST = 1e-3  # lower bound of the torque that dry friction leaves, as a share of the limit: a divisor
_DISTANCE = 0.25  # clearance equivalent to a whole limit [m]


class LinearTorqueModel(Protocol):
    """A torque model that is linear in P parameters: rigid body first, then terms of single joints."""

    body: RigidBody
    extras: Array  # term · J + joint for each parameter of a term
    terms: Any  # their ``kinds`` and ``sign_width``


@dataclass(frozen=True, eq=False)
class Goal:
    """A function of a trajectory to minimise, in terms of the P parameters of a model.

    The logarithm of the condition number of prior plus information; of the sum of the targets' variances, or
    of the volume of their uncertainty; or of that of a tool's parameters, whose effects on torque are the
    targets, with the arm's parameters unknown too.
    """

    kind: Literal["condition", "variance", "volume", "tool"] = "condition"
    prior: Array | None = None  # prior information, (P, P)
    certainty: Array | None = None  # inverse standard deviation of each joint's torque, (J,); None: ones
    rate: float = 1.0  # of samples with independent errors [Hz]
    model: LinearTorqueModel | None = None  # to identify, with friction and rotors; None: rigid bodies
    targets: Array | None = None  # (R, P)
    tool_prior: Array | None = None  # prior information on a tool, (R, R)
    runs: int = 1  # 2: a tool's trajectory is also executed without it


def _kernel_goal(
    goal: Goal, body: RigidBody, period: float
) -> tuple[information.JointTerms, Array, goals.GoalArrays]:
    """A goal for trajectories of a period [s], in the form that kernels take; ShapeError if it does not fit.

    Returns the model's terms with the certainty of joints; the map from coordinates in an orthonormal basis
    to parameters, lower triangular, (P, P); and the goal in these coordinates. Parameters are the base
    parameters, then those of terms, joint by joint.
    """
    rigid = len(body.base.columns)
    if goal.model is not None and not np.array_equal(goal.model.body.base.columns, body.base.columns):
        raise ShapeError("the model is for another arm: its base parameters differ")
    extras = np.zeros(0, np.int64) if goal.model is None else goal.model.extras
    kinds, joints = np.divmod(extras, body.joints)
    by_joint = np.argsort(joints, kind="stable")
    terms = information.no_terms(body.joints)
    if goal.model is not None:
        first = np.searchsorted(joints[by_joint], np.arange(body.joints + 1))
        named = [information.TERM_KINDS.index(goal.model.terms.kinds[k]) for k in kinds[by_joint].tolist()]
        sign_width = goal.model.terms.sign_width
        terms = information.JointTerms(np.array(named, np.int64), first, sign_width, np.ones(body.joints))
    if goal.certainty is not None:
        terms = terms._replace(roots=_fitting("certainty", goal.certainty, (body.joints,)))
    order = np.concatenate([np.arange(rigid), rigid + by_joint])
    size = len(order)
    count = 0 if goal.targets is None else len(goal.targets)
    subspace = np.eye(size)
    subspace[:rigid, :rigid] = body.base.subspace
    prior = _fitting("prior", goal.prior, (size, size))[np.ix_(order, order)]
    targets = _fitting("targets", goal.targets, (count, size))[:, order]
    # A tool's targets are columns of torque; others are directions of parameters.
    targets = np.linalg.solve(subspace, targets.T).T if goal.kind == "tool" else targets @ subspace
    arrays = goals.GoalArrays(
        goals.KINDS.index(goal.kind),
        np.ascontiguousarray(subspace.T @ prior @ subspace),
        goal.rate * period,
        np.ascontiguousarray(targets),
        _fitting("tool_prior", goal.tool_prior, (count, count)),
        float(goal.runs),
    )
    return terms, subspace, arrays


def _fitting(name: str, given: Array | None, shape: tuple[int, ...]) -> Array:
    """Finite numbers of a shape; zeros if None."""
    if given is None:
        return np.zeros(shape)
    if given.shape != shape or not np.isfinite(given).all():
        raise ShapeError(f"{name} of the goal is {given.shape}, expected finite numbers {shape}")
    return np.ascontiguousarray(given, float)


@dataclass(frozen=True)
class Penalty:
    """Cost of violated constraints: squared relative violations, with a reserve."""

    weight: float
    limits: float = 0.05  # share of position, velocity, acceleration and jerk kept in reserve
    torque: float = 0.05  # share of torque limits kept in reserve
    distance: float = 0.1  # share of 0.25 m kept in reserve


class Objective:
    """Goal and penalty of single trajectories; not thread-safe.

    Args:
        problem: constraints and family of the trajectories.
        goal: to minimise.
        penalty: of violations; None: no penalty.
        refine: points per sample, odd, at which limits on motion and distances are evaluated.
        matrix: maps points to coefficients [rad/s], (J, K, K), symmetric; None: points are coefficients.
    """

    def __init__(
        self,
        problem: Problem,
        goal: Goal,
        penalty: Penalty | None = None,
        refine: int = 1,
        matrix: Array | None = None,
    ) -> None:
        constraints, trajectory, body = problem.constraints, problem.trajectory, problem.body
        arm, drives = body.arm, body.arm.known_drives
        terms, subspace, arrays = _kernel_goal(goal, body, trajectory.period)
        joints, harmonics, _ = trajectory.shape
        torque = np.maximum(arm.torque_limit - drives.coulomb, _LEAST * arm.torque_limit)
        higher = array(constraints.higher_rows).reshape(-1, joints)
        if matrix is None:
            matrix = np.tile(np.eye(2 * harmonics), (joints, 1, 1))

        def basis(points: int, orders: int) -> Array:
            times = trajectory.grid(points)
            return array(np.stack([flatten(trajectory.basis(times, k), 1).T for k in range(orders)]))

        self.samples = problem.samples
        self.finer = refine * problem.samples
        self.plan = kernel.Plan(
            chain=body.chain,
            shapes=constraints.bodies.shapes,
            columns=columns_of_links(body.base.columns, joints),
            extra=terms,
            subspace=subspace,
            home=np.array(trajectory.home),
            matrix=array(matrix),
            basis=basis(self.samples, 3),
            fine=basis(self.finer, 2 + len(higher)),
            limits=PenaltyLimits(
                weight=0.0,
                reserve=0.0,
                torque_weight=0.0,
                torque_reserve=0.0,
                middle=(arm.position_upper + arm.position_lower) / 2,
                room=(arm.position_upper - arm.position_lower) / 2,
                speed=array(arm.velocity_limit),
                torque=torque if constraints.torque else np.full(joints, np.inf),
                parameters=array(arm.inertial_parameters.ravel()),
                viscous=array(drives.viscous),
                rotor=array(drives.rotor_inertia),
            ),
            higher=higher,
            box=np.inf if problem.box is None else problem.box,
            close=0.0,
            reach=0.0,
            goal=arrays,
        )
        if penalty is not None:
            self.plan = self.penalised(penalty)
        self.scratch = kernel.plan_buffers(self.plan)

    def penalised(self, penalty: Penalty) -> kernel.Plan:
        """The plan with another penalty."""
        torque_weight = penalty.weight if np.isfinite(self.plan.limits.torque).any() else 0.0
        limits = self.plan.limits._replace(
            weight=penalty.weight / self.finer,
            reserve=penalty.limits,
            torque_weight=torque_weight / self.samples,
            torque_reserve=penalty.torque,
        )
        close = penalty.weight / _DISTANCE**2  # weight of the squared shortfall of a distance [1/m²]
        return self.plan._replace(limits=limits, close=close / self.finer, reach=penalty.distance * _DISTANCE)

    def __call__(self, x: Array, gradient: Array) -> tuple[float, float]:
        """Goal and penalty of a point (J, K); writes the gradient of their sum, (J, K)."""
        joints, functions = x.shape
        state = descent.descent_state(joints, functions, 0)
        state.x[:] = x.ravel()
        descent.descend(self.plan, state, self.scratch, 1)
        gradient[:] = state.gradient.reshape(x.shape)
        return float(state.numbers[descent.GOAL]), float(state.numbers[descent.COST])


def evaluator(problem: Problem) -> Callable[[Array], Array]:
    """Function that evaluates fitness and margins for an optimiser without gradients; not thread-safe.

    It maps contiguous coefficients [rad/s], (B, J, H, 2), to log fitness and the negated worst relative
    margin of each constraint, in the order of labels, (B, 1 + G). A metre of distance counts like a whole
    limit.
    """
    objective = Objective(problem, Goal())
    kept = [0, *(1 + CONSTRAINTS.index(name) for name in problem.constraints.labels)]

    def evaluate(c: Array) -> Array:
        numbers = np.empty((len(c), kernel.NUMBERS))
        x = c.reshape(*c.shape[:2], -1)
        kernel.evaluate(objective.plan, problem.weakest, x, numbers, objective.scratch)
        return numbers[:, kept]

    return evaluate


def pull_back(
    problem: Problem,
    c: Array,
    vectors: Array,
    weights: Array,
    penalty: Penalty | None = None,
    certainty: Array | None = None,
) -> tuple[Array, Array]:
    """Penalty, (B,), and the gradient of penalty plus energy, (B, J, H, 2), at coefficients c [rad/s].

    The energy is Σ weight · |Y v|² / T over directions v, (B, D, p), with weights (B, D), D ≤ p. With
    eigenvectors of YᵀY / T and the derivatives of a function of its eigenvalues, its gradient is that of the
    function. The rows of Y are scaled by each joint's certainty, (J,).
    """
    x, v, w = array(flatten(c, 2)), array(vectors), array(weights)
    cost, gradient = np.empty(len(x)), np.empty(x.shape)

    def work(k: slice) -> None:
        local = Objective(problem, Goal(certainty=certainty), penalty)  # for this thread
        for n in range(len(x))[k]:
            cost[n] = kernel.energy_gradient(local.plan, x[n], v[n], w[n], gradient[n], local.scratch)

    share(work, len(x), problem.samples)
    return cost, gradient.reshape(c.shape)
