"""The model of an arm's torque: rigid-body base parameters, rotor inertias and friction, linear in all."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.typed import Positive
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import LINK_PARAMETERS, RigidBody
from sidegan.robot import Arm

# Relative length of a column's new part. A right angle that is written as 1.5708 leaves 4e-6, a calibrated
# one that is 0.5 mrad off 1e-3, and a true one 0.5: less than a hundredth is not told by any motion.
_DEPENDENT = 0.01
_NO_PART = 1e-10  # a smaller coefficient in a grouping is rounding
_SPREAD = 5.0  # times the new part that a grouping neglects: no larger a part of it only makes up for that
_STATES_PER_JOINT = 60
_USUAL = 400  # random states that stand for where the model is to hold
_PACE = 0.5  # of the velocity limits, and 2.5 rad/s²: how fast the arm moves there
_ACCELERATION = 5.0  # [rad/s²] of the states that groupings are found with
_DIGITS = 4  # of a share in a formula
_LETTERS = {"rotor_inertia": "Ia", "viscous": "fv", "coulomb": "fc", "offset": "fo"}


@dataclass(frozen=True, kw_only=True)
class Terms:
    """Terms of a joint's torque beside rigid bodies."""

    rotor_inertia: bool = False  # Ia · ddq, where the rigid bodies do not explain it already
    viscous: bool = True  # fv · dq
    coulomb: bool = True  # fc · tanh(dq / sign_width)
    offset: bool = True  # fo
    sign_width: Positive = 0.03  # velocity [rad/s or m/s] at which the smooth sign is at 76 %

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the terms in use, in the order of their columns."""
        return tuple(name for name in _LETTERS if getattr(self, name))

    def signals(self, dq: Array, ddq: Array, sign: Array | None = None) -> list[Array]:
        """Columns of each term in use, (S, J) each, at velocities and accelerations (S, J).

        Coulomb friction follows ``sign``, tanh(dq / sign_width) when None.
        """
        if sign is None:
            sign = np.tanh(dq / self.sign_width)
        values = {"rotor_inertia": ddq, "viscous": dq, "coulomb": sign, "offset": np.ones_like(dq)}
        return [values[name] for name in self.kinds]


# Of torques from motor currents, and of rigid bodies alone, as simulated measurements are.
FULL = Terms(rotor_inertia=True, sign_width=0.01)
RIGID = Terms(viscous=False, coulomb=False, offset=False, sign_width=0.01)


class TorqueModel:
    """A model of an arm's torque, τ = Y θ with P parameters θ.

    The rigid-body base parameters come first, in ``body.base``'s order, then per term the joints' own
    parameters. A parameter that has the same effect as those before it (such as the rotor inertia of the
    first joint and the inertia about its axis) has no column: it is grouped into theirs.

    Attributes:
        names: of the parameters, such as "Izz6" or "fv3", (P,).
        rigid: number of base parameters, the first of the P.
        kinds: names of the terms in use, in the order of their columns.
        standard_names: of the J links' ten parameters and then each term's J, (F,).
        extras: indices among all terms' parameters, (kinds · J), of those that have a column.
        mapping: parameters from standard ones, (P, F).

    Source: Gautier 1991, Numerical calculation of the base inertial parameters of robots.
    """

    def __init__(self, body: RigidBody, terms: Terms = FULL) -> None:
        self.body = body
        self.arm = body.arm
        self.terms = terms
        self.kinds = terms.kinds
        self.joints = joints = body.joints
        self.rigid = rigid = len(body.base.values)
        links = [f"{name}{i + 1}" for i in range(joints) for name in LINK_PARAMETERS]
        names = [f"{_LETTERS[k]}{i + 1}" for k in self.kinds for i in range(joints)]
        self.extras, grouped = self._grouped()
        self.standard_names = [*links, *names]
        nothing = np.zeros((len(self.extras), 10 * joints))
        self.mapping = np.block([[body.base.mapping, grouped[:rigid]], [nothing, grouped[rigid:]]])
        self.names = [*body.base.names, *(names[k] for k in self.extras)]
        self.count = len(self.names)

    @cached_property
    def formulas(self) -> list[str]:
        """Formula of each parameter, such as "Izz6 + Iyy7 + 0.0061 m7", (P,)."""
        return [formula(row, self.standard_names) for row in self.mapping]

    @cached_property
    def nominal(self) -> Array:
        """Parameters of the arm's description, without friction and rotor inertia, (P,)."""
        return self.mapping[:, : 10 * self.joints] @ self.arm.inertial_parameters.ravel()

    def links_of(self, standard: Array) -> Array:
        """The links' inertial parameters, (J, 10), among standard parameters (F,)."""
        return standard[: 10 * self.joints].reshape(-1, 10)

    def standard_slice(self, term: str) -> slice:
        """Places of a term's J parameters among the standard ones."""
        start = (10 + self.kinds.index(term)) * self.joints
        return slice(start, start + self.joints)

    def usual_states(self, seed: int = 1) -> tuple[Array, Array, Array]:
        """Random states (S, J) at half of the velocity limits, where the model is to hold."""
        q, dq, ddq = states_within(self.arm, _USUAL, seed=seed)
        return q, _PACE * dq, _PACE * ddq

    def regressor(self, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Regressor Y, (S, J, P), of states (S, J), with torque = Y θ [N·m or N].

        Coulomb friction follows ``sign``, tanh(dq / sign_width) when None. Y is a view of an array with the
        states last, in which products over samples are fast.

        Raises:
            ShapeError: when a shape does not fit the arm.
        """
        if q.ndim != 2:
            raise ShapeError(f"position is {q.shape}, expected (S, {self.joints})")
        y = np.zeros((self.joints, self.count, len(q)))
        y[:, : self.rigid] = self.body.base_regressor(q, dq, ddq).transpose(1, 2, 0)
        signals = self.terms.signals(dq, ddq, sign)
        for place, k in enumerate(self.extras.tolist(), start=self.rigid):
            y[k % self.joints, place] = signals[k // self.joints][:, k % self.joints]
        return y.transpose(2, 0, 1)

    def torque(self, parameters: Array, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Torque [N·m or N], (S, J), of parameters (P,) at states (S, J)."""
        return torques_of(self.regressor(q, dq, ddq, sign), parameters)

    def _grouped(self) -> tuple[Array, Array]:
        """Indices of the extra columns that are independent, and all extras' shares in the P parameters."""
        joints, base = self.joints, self.body.base
        if not self.kinds:
            return np.zeros(0, dtype=int), np.zeros((len(base.values), 0))
        q, dq, ddq = states_within(self.arm, _STATES_PER_JOINT * joints)
        rigid = self.body.base_regressor(q, dq, ddq).reshape(-1, len(base.values))
        signals = [x[..., None] * np.eye(joints) for x in self.terms.signals(dq, ddq)]
        extra = np.concatenate(signals, 2).reshape(len(rigid), -1)
        y = np.concatenate([rigid, extra], 1)
        new = np.abs(np.diag(np.linalg.qr(y / np.linalg.norm(y, axis=0))[1]))[rigid.shape[1] :]
        kept = np.flatnonzero(new > _DEPENDENT)
        basis = np.concatenate([rigid, extra[:, kept]], 1)
        norms = np.linalg.norm(basis, axis=0)
        parts = np.linalg.lstsq(basis / norms, extra, rcond=None)[0]  # of the length of an extra's column
        parts[np.abs(parts) <= _SPREAD * new * np.linalg.norm(extra, axis=0)] = 0.0
        shares = parts / norms[:, None]
        shares[np.abs(shares) < _NO_PART] = 0.0
        shares[:, kept] = np.eye(len(norms))[:, rigid.shape[1] :]
        return kept, shares


def torques_of(y: Array, parameters: Array) -> Array:
    """Torques Y θ, (S, J), of a regressor (S, J, P) in which states are next to each other in memory."""
    return np.einsum("sjp,p->sj", y, parameters)  # six times as fast as @ there


def states_within(arm: Arm, count: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Random positions and velocities within an arm's limits and accelerations within ±5, (count, J) each.

    Slow velocities are as frequent as fast ones are: friction changes most there.
    """
    draw = np.random.default_rng(seed).random((3, count, arm.joints))
    q = arm.position_lower + (arm.position_upper - arm.position_lower) * draw[0]
    return q, arm.velocity_limit * (2 * draw[1] - 1) ** 3, _ACCELERATION * (2 * draw[2] - 1)


def formula(shares: Array, names: Sequence[str]) -> str:
    """A grouping as text, such as "m6 + 0.078 m7", from each parameter's share (F,) and name."""
    parts = [(share, name) for share, name in zip(shares.tolist(), names) if share != 0.0]
    words = []
    sized = [(f"{abs(share):.{_DIGITS}g}", share, name) for share, name in parts]
    for size, share, name in sorted(sized, key=lambda part: part[0] != "1" or part[1] < 0):
        words += ["-" if share < 0 else "+", name if size == "1" else f"{size} {name}"]
    return " ".join(words).removeprefix("+ ")
