"""Design goals of trajectories, and their form for compiled kernels."""

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.kernels import goals, information
from sidegan.motion.dynamics import RigidBody

_KINDS = {
    "condition": goals.CONDITION,
    "variance": goals.VARIANCE,
    "volume": goals.VOLUME,
    "tool": goals.TOOL,
}


class Linear(Protocol):
    """A torque model that is linear in P parameters: rigid body first, then terms of single joints."""

    body: RigidBody
    extras: Array  # term · J + joint for each parameter of a term

    @property
    def terms(self) -> Any:
        """The terms: their ``kinds`` and ``sign_width``."""


@dataclass(frozen=True, eq=False)
class Goal:
    """A function of a trajectory to minimise, in terms of the P parameters of a model.

    The condition number of prior plus information; the sum of the targets' variances, or the volume of their
    uncertainty; or that of a tool's parameters, whose effects on torque are the targets, with the arm's
    parameters unknown too.
    """

    kind: Literal["condition", "variance", "volume", "tool"] = "condition"
    prior: Array | None = None  # prior information, (P, P)
    certainty: Array | None = None  # inverse standard deviation of each joint's torque, (J,); None: ones
    rate: float = 1.0  # of samples with independent errors [Hz]
    model: Linear | None = None  # to identify, with friction and rotors; None: rigid bodies
    targets: Array | None = None  # (R, P)
    doubt: Array | None = None  # prior information on a tool, (R, R)
    runs: int = 1  # 2: a tool's trajectory is also executed without it


def compiled(
    goal: Goal, body: RigidBody, period: float
) -> tuple[information.JointTerms, Array, goals.GoalArrays]:
    """A goal for trajectories of a period [s], in the form that kernels take.

    Returns the model's terms with the certainty of joints; the map from coordinates in an orthonormal basis
    to parameters, lower triangular, (P, P); and the goal in these coordinates. Parameters are the base
    parameters, then those of terms, joint by joint.

    Raises:
        ShapeError: for a model of a different arm, or when a shape does not fit the model.
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
        named = [information.KINDS.index(goal.model.terms.kinds[k]) for k in kinds[by_joint].tolist()]
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
        _KINDS[goal.kind],
        np.ascontiguousarray(subspace.T @ prior @ subspace),
        goal.rate * period,
        np.ascontiguousarray(targets),
        _fitting("doubt", goal.doubt, (count, count)),
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
