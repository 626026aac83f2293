"""The model of an arm's torque, linear in rigid-body base parameters, rotor inertias and friction."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.base.typed import Positive
from sidegan.errors import ShapeError
from sidegan.identification.effects import Effects, KindName, forms
from sidegan.motion.dynamics import LINK_PARAMETERS, RigidBody
from sidegan.robot import Arm, possible_links

# A column is dependent if less than this share of its length is new. The share is 4e-6 for a right angle
# written as 1.5708, 1e-3 for an angle calibrated to 0.5 mrad, and 0.5 for a parameter of its own: no motion
# identifies a parameter with less than 1 %.
_DEPENDENT = 0.01
_NO_PART = 1e-10  # a smaller coefficient in a grouping is rounding
_SPREAD = 5.0  # coefficients up to this multiple of the neglected new part are artefacts of neglecting it
_STATES_PER_JOINT = 60
_USUAL = 400  # random states that represent the model's range of use
_PACE = 0.5  # share of the velocity limits, and of ``_ACCELERATION``, in that range
_ACCELERATION = 5.0  # [rad/s²] largest acceleration of the states that groupings are found with
_DIGITS = 4  # of a coefficient in a formula
_LIGHT, _SMALL = 0.02, 0.05  # least typical mass, as a share of the heaviest link's, and length [m]
POWERS = np.array([0.0, 1, 1, 1, 2, 2, 2, 2, 2, 2])  # of length in each link parameter
_LETTERS = {"rotor_inertia": "Ia", "viscous": "fv", "coulomb": "fc", "offset": "fo"}


@dataclass(frozen=True, kw_only=True)
class Terms:
    """Terms of a joint's torque in addition to rigid bodies."""

    rotor_inertia: bool = False  # Ia · ddq, unless a rigid-body parameter has the same effect
    viscous: bool = True  # fv · dq
    coulomb: bool = True  # fc · tanh(dq / sign_width)
    offset: bool = True  # fo
    sign_width: Positive = 0.03  # velocity [rad/s or m/s] at which the smooth sign reaches 76 %
    # further effects that identify models: those for which data held out speak, or of joints by name
    effects: Literal["auto", "none"] | dict[str, list[KindName]] = "auto"

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the terms in use, in the order of their columns."""
        return tuple(name for name in _LETTERS if getattr(self, name))

    def signals(self, dq: Array, ddq: Array, sign: Array | None = None) -> list[Array]:
        """Columns of each term in use, (S, J) each, at velocities and accelerations (S, J).

        Coulomb friction follows ``sign``, tanh(dq / sign_width) when None.
        """
        ones, sign = np.ones_like(dq), self.sign(dq) if sign is None else sign
        values = {"rotor_inertia": ddq, "viscous": dq, "coulomb": sign, "offset": ones}
        return [values[name] for name in self.kinds]

    def sign(self, dq: Array) -> Array:
        """Smooth sign of velocities."""
        return np.tanh(dq / self.sign_width)


# For torques from motor currents, and for rigid bodies alone, such as simulated arms.
FULL = Terms(rotor_inertia=True, sign_width=0.01)
RIGID = Terms(viscous=False, coulomb=False, offset=False, sign_width=0.01)


class TorqueModel:
    """A model of an arm's torque, τ = Y θ with P parameters θ.

    The rigid-body base parameters come first, in ``body.base``'s order, then one parameter per term and
    joint, then those of effects. A term's parameter with the same effect as earlier ones (the rotor inertia
    of the first joint and the link's inertia about its axis) has no column: it is grouped into theirs.

    Attributes:
        effects: effects on single joints that are terms, too; None if there are none.
        names: names of the parameters, such as "Izz6" or "fv3", (P,).
        rigid: number of base parameters, the first of the P.
        moved: number of these and of rotor inertias, which follow: their torque is the effects' load.
        kinds: names of the terms in use, in the order of their columns.
        standard_names: names of each link's ten parameters, each term's J, and the effects', (F,).
        extras: indices, among all terms' kinds · J parameters, of those that have a column.
        mapping: maps standard parameters to the model's, (P, F).

    Source: Gautier 1991, Numerical calculation of the base inertial parameters of robots.
    """

    def __init__(self, body: RigidBody, terms: Terms = FULL, effects: Effects | None = None) -> None:
        self.body = body
        self.arm = body.arm
        self.terms, self.effects = terms, effects
        self.kinds = terms.kinds
        self.joints = joints = body.joints
        self.rigid = rigid = len(body.base.values)
        links = [f"{name}{i + 1}" for i in range(joints) for name in LINK_PARAMETERS]
        names = [f"{_LETTERS[k]}{i + 1}" for k in self.kinds for i in range(joints)]
        self.extras, grouped = self._grouped()
        rotors = joints if "rotor_inertia" in self.kinds else 0
        self.moved = rigid + int((self.extras < rotors).sum())
        further = [] if effects is None else effects.names
        self.standard_names = [*links, *names, *further]
        nothing = np.zeros((len(self.extras), 10 * joints))
        mapping = np.block([[body.base.mapping, grouped[:rigid]], [nothing, grouped[rigid:]]])
        self.mapping = scipy.linalg.block_diag(mapping, np.eye(len(further)))
        self.names = [*body.base.names, *(names[k] for k in self.extras), *further]
        self.count = len(self.names)

    @cached_property
    def formulas(self) -> list[str]:
        """Formula of each parameter, such as "Izz6 + Iyy7 + 0.0061 m7", (P,)."""
        return [formula(row, self.standard_names) for row in self.mapping]

    @cached_property
    def nominal(self) -> Array:
        """Parameters from the arm's description, without friction and rotor inertia, (P,)."""
        return self.mapping[:, : 10 * self.joints] @ self.arm.inertial_parameters.ravel()

    @property
    def terms_mapping(self) -> Array:
        """Maps terms and effects to the model's parameters, grouped ones too, (P, F − 10 J)."""
        return self.mapping[:, 10 * self.joints :]

    def links_of(self, standard: Array) -> Array:
        """The links' inertial parameters, (J, 10), from standard parameters (F,)."""
        return standard[: 10 * self.joints].reshape(-1, 10)

    def standard_slice(self, term: str) -> slice:
        """Slice of a term's J parameters in the standard ones."""
        start = (10 + self.kinds.index(term)) * self.joints
        return slice(start, start + self.joints)

    def usual_states(self, seed: int = 1) -> tuple[Array, Array, Array]:
        """Random states (S, J) up to half of the velocity limits: the model's range of use."""
        q, dq, ddq = states_within(self.arm, _USUAL, seed=seed)
        return q, _PACE * dq, _PACE * ddq

    def regressor(
        self, q: Array, dq: Array, ddq: Array, sign: Array | None = None, load: Array | None = None
    ) -> Array:
        """Regressor Y, (S, J, P), of states (S, J), with torque = Y θ [N·m or N].

        Coulomb friction follows ``sign``, tanh(dq / sign_width) when None, and friction that grows with the
        load follows the torque of ``load``, the first ``moved`` parameters, those of the effects when None.
        In memory the states are the last axis, which makes products over samples fast.

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
        if effects := self.effects:
            moved = torques_of(y[:, : self.moved].transpose(2, 0, 1), effects.load if load is None else load)
            shapes = forms(q, dq, self.terms.sign(dq) if sign is None else sign, moved / effects.usual)
            for place, (j, form) in enumerate(effects.columns, start=self.rigid + len(self.extras)):
                y[j, place] = shapes[form, :, j]
        return y.transpose(2, 0, 1)

    def torque(self, parameters: Array, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Torque [N·m or N], (S, J), from parameters (P,) at states (S, J); the load is their own."""
        return torques_of(self.regressor(q, dq, ddq, sign, parameters[: self.moved]), parameters)

    def _grouped(self) -> tuple[Array, Array]:
        """Indices of the independent extra columns, and all extras' coefficients in the P parameters."""
        joints = self.joints
        base = self.body.base
        if not self.kinds:
            return np.zeros(0, dtype=int), np.zeros((len(base.values), 0))
        q, dq, ddq = states_within(self.arm, _STATES_PER_JOINT * joints)
        rigid = self.body.base_regressor(q, dq, ddq).reshape(-1, len(base.values))
        signals = [x[..., None] * np.eye(joints) for x in self.terms.signals(dq, ddq)]
        extra = np.concatenate(signals, 2).reshape(len(rigid), -1)
        directions = np.linalg.qr(rigid / np.linalg.norm(rigid, axis=0))[0]
        new = np.zeros(extra.shape[1])  # share of each column that those before it lack
        for k, column in enumerate(extra.T / np.linalg.norm(extra, axis=0)[:, None]):
            for _ in range(2):  # Gram-Schmidt, twice
                column = column - directions @ (directions.T @ column)
            new[k] = np.linalg.norm(column)
            if new[k] > _DEPENDENT:  # what a dependent one has left may be all of a later one
                directions = np.column_stack([directions, column / new[k]])
        kept = np.flatnonzero(new > _DEPENDENT)
        basis = np.concatenate([rigid, extra[:, kept]], 1)
        norms = np.linalg.norm(basis, axis=0)
        parts = np.linalg.lstsq(basis / norms, extra, rcond=None)[0]
        parts[np.abs(parts) <= _SPREAD * new * np.linalg.norm(extra, axis=0)] = 0.0
        shares = parts / norms[:, None]
        shares[np.abs(shares) < _NO_PART] = 0.0
        shares[:, kept] = np.eye(len(norms))[:, rigid.shape[1] :]
        return kept, shares


def torques_of(y: Array, parameters: Array) -> Array:
    """Torques Y θ, (S, J), of a regressor (S, J, P) with the states contiguous in memory."""
    return np.einsum("sjp,p->sj", y, parameters)  # six times as fast as @ in this layout


def states_within(arm: Arm, count: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Random positions and velocities within an arm's limits, accelerations within ±5, (count, J) each.

    Velocities are denser near zero, where friction changes most.
    """
    draw = np.random.default_rng(seed).random((3, count, arm.joints))
    q = arm.position_lower + (arm.position_upper - arm.position_lower) * draw[0]
    return q, arm.velocity_limit * (2 * draw[1] - 1) ** 3, _ACCELERATION * (2 * draw[2] - 1)


def formula(shares: Array, names: Sequence[str]) -> str:
    """A grouping as text, such as "m6 + 0.078 m7", from each parameter's coefficient (F,) and name."""
    words = []
    parts = [(f"{abs(x):.{_DIGITS}g}", x, name) for x, name in zip(shares.tolist(), names) if x != 0.0]
    for size, share, name in sorted(parts, key=lambda part: part[0] != "1" or part[1] < 0):
        words += ["-" if share < 0 else "+", name if size == "1" else f"{size} {name}"]
    return " ".join(words).removeprefix("+ ")


def scales(arm: Arm) -> tuple[Array, Array]:
    """Typical mass [kg] and length [m] of each link, (J,) each, from the description."""
    x = possible_links(arm)
    mass = np.maximum(x[:, 0], _LIGHT * x[:, 0].max())
    gyration = np.sqrt(np.maximum(x[:, 4] + x[:, 6] + x[:, 9], 0) / 2 / mass)
    return mass, np.maximum(gyration, _SMALL)


def typical(arm: Arm) -> Array:
    """Typical size of each link parameter, (J, 10): m, m l and m l²."""
    mass, length = scales(arm)
    return mass[:, None] * length[:, None] ** POWERS
