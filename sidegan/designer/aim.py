"""What a designed trajectory shall be good for."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch

from sidegan.design.criteria import root_of
from sidegan.design.linear import Linear
from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.arrays import array
from sidegan.motion.dynamics import RigidBody

Array = np.ndarray
Kind = Literal["condition", "diagonal", "determinant", "variance"]

_NO_PART = {"prior": "a prior has", "model": "a model has", "interest": "links of interest have"}


@dataclass(frozen=True, eq=False)
class Numbers:
    """An aim in numbers, for those who calculate.

    Parameters are the base parameters, then those of single joints, joint by joint. The basis is orthonormal
    for rigid bodies, as ``information_of`` has it; the others keep their units.
    """

    order: Array  # of the parameters among the model's, (P,)
    terms: Array  # joint, and which of the model's terms, of those of single joints, (E, 2)
    subspace: Array  # parameters from coordinates in the basis, lower triangular, (P, P)
    prior: Array  # (P, P)
    targets: Array  # what variances are of, (R, P) with R ≤ P


@dataclass(frozen=True, eq=False)
class Aim:
    """What a trajectory shall be good for.

    The condition number of YᵀY or the ratio of its diagonal is made small; or log det of the whole
    information, that of the prior and of the trajectory, large, or log det of the covariance of links'
    parameters small; or variances small: of base parameters, or of torques that are predicted for tasks.
    """

    kind: Kind = "condition"
    # information that there is already: in the orthonormal basis of ``information_of``, (p, p), or on a
    # model's parameters, (P, P)
    prior: Array | None = None
    noise: Sequence[float] | None = None  # standard deviation of each joint's torque [N·m or N], (J,)
    # weight of the variances of each link's base parameters; log det is of the links that have any, and of
    # the terms of their joints
    interest: Mapping[str, float] | None = None
    model: Linear | None = None  # what is identified, friction and rotors included; None: rigid bodies
    tasks: Array | None = None  # mean YᵀY of motions whose torques are to be predicted, (P, P)

    def __post_init__(self) -> None:
        if self.kind not in ("condition", "diagonal", "determinant", "variance"):
            raise ConfigError(
                f"an aim is {self.kind!r}, expected condition, diagonal, determinant or variance"
            )
        if self.kind in ("condition", "diagonal"):
            for name, said in _NO_PART.items():
                if getattr(self, name) is not None:
                    raise ConfigError(
                        f"{said} no part in the aim {self.kind!r}: ask for determinant or variance"
                    )
        if self.tasks is not None and self.kind != "variance":
            raise ConfigError(f"tasks have no part in the aim {self.kind!r}: ask for variance")
        if self.tasks is not None and self.interest is not None:
            raise ConfigError("links of interest have no part in the prediction of torques: leave them out")

    def numbers(self, body: RigidBody) -> Numbers:
        """The aim of an arm, in numbers.

        Raises:
            ConfigError: for links of interest that are none or have no parameters of their own.
            ShapeError: for a model of another arm; when prior or tasks are not symmetric and positive
                semidefinite matrices that fit.
        """
        columns, rigid = array(body.base.columns), len(body.base.columns)
        extras = np.zeros(0, np.int64) if self.model is None else array(self.model.extras)
        if self.model is not None and not torch.equal(self.model.body.base.columns, body.base.columns):
            raise ShapeError("the model is of another arm: it has other base parameters")
        joints = extras % body.joints
        by_joint = np.argsort(joints, kind="stable")
        order = np.concatenate([np.arange(rigid), rigid + by_joint])
        terms = np.stack([joints, extras // body.joints], 1)[by_joint]
        subspace = np.eye(len(order))
        subspace[:rigid, :rigid] = array(body.base.subspace)
        if self.tasks is None:
            links = columns // 10
            if self.kind == "determinant":
                links = np.concatenate([links, terms[:, 0]])
            weights = self._interest(body.arm.link_names, links)
            targets = (np.sqrt(weights)[:, None] * subspace[: len(links)])[weights > 0]
        else:
            tasks = _semidefinite("tasks", self.tasks, len(order))[np.ix_(order, order)]
            targets = root_of(torch.from_numpy(tasks)).T.numpy() @ subspace
        return Numbers(order, terms, subspace, self._prior(order, subspace), np.ascontiguousarray(targets))

    def _prior(self, order: Array, subspace: Array) -> Array:
        """The prior in the basis, or none, (P, P)."""
        if self.prior is None:
            return np.zeros_like(subspace)
        prior = _semidefinite("prior", self.prior, len(order))
        if self.model is None:
            return prior
        return subspace.T @ prior[np.ix_(order, order)] @ subspace

    def roots_of(self, joints: int) -> Array:
        """What the torque of each joint is multiplied by before it counts, (J,).

        Raises:
            ShapeError: when the noise is not one positive number per joint.
        """
        if self.noise is None:
            return np.ones(joints)
        noise = np.array(list(self.noise), dtype=float)
        if noise.shape != (joints,) or not (np.isfinite(noise) & (noise > 0)).all():
            raise ShapeError(f"noise {self.noise} must be {joints} positive numbers")
        return 1 / noise

    def _interest(self, names: Sequence[str], links: Array) -> Array:
        """Weight of each parameter, whose links are given by number, (P,)."""
        if self.interest is None:
            return np.ones(len(links))
        weights = np.zeros(len(links))
        for name, weight in self.interest.items():
            if name not in names:
                raise ConfigError(f"links has {name!r}, expected some of {', '.join(names)}")
            rows = links == list(names).index(name)
            if not rows.any():
                raise ConfigError(f"links has {name!r}, which has no parameters of its own to learn")
            if not (math.isfinite(weight) and weight >= 0):
                raise ConfigError(f"interest in {name!r} is {weight}, expected zero or more")
            weights[rows] = weight
        if not weights.any():
            raise ConfigError("interest gives no link any weight")
        return weights


def noise_at(rate: float, information: torch.Tensor) -> list[float]:
    """Deviation of each joint's torque [N·m or N] that samples at a rate [Hz] have, (J,).

    Of independent samples, which tell as much in a second as ``information`` says, (J,).
    """
    return (rate / information).sqrt().tolist()


def _semidefinite(name: str, given: Array, size: int) -> Array:
    """A matrix of so many parameters that is one of information, (P, P)."""
    matrix = np.array(given, dtype=float)
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise ShapeError(f"{name} is {matrix.shape}, expected finite numbers ({size}, {size})")
    slack = 1e-9 * float(np.abs(matrix).max())
    if np.abs(matrix - matrix.T).max() > slack or np.linalg.eigvalsh(matrix)[0] < -slack:
        raise ShapeError(f"{name} is not symmetric and positive semidefinite")
    return (matrix + matrix.T) / 2
