"""The regressor of one state at a time, in NumPy: for on-line use, where a batch would come too late."""

import numpy as np
from numpy.typing import NDArray

from sidegan.identification.model import Model
from sidegan.robot import Arm

Array = NDArray[np.float64]


class SingleRegressor:
    """Regressor of a model, (J, P), one state at a time in tens of microseconds.

    Link velocities and accelerations are sums along the chain of vectors in the world frame, so that only the
    rotations need a loop over joints. It gives what ``Model.regressor`` does.

    Args:
        model: whose columns come out.
    """

    def __init__(self, model: Model) -> None:
        self._model, joints = model, model.joints
        self._chain = _Chain(model.arm)
        self._columns = model.body.base.columns.numpy()
        # Link i acts on joints up to i only.
        self._acts = np.repeat(np.triu(np.ones((joints, joints))), 10, axis=1)[:, self._columns]
        kept = np.array([model.standard_names.index(n) for n in model.names[model.rigid :]], dtype=int)
        self._term, self._joint = np.divmod(kept - 10 * joints, joints)
        self._place = np.arange(model.rigid, model.count)
        self._stribeck = None if model.stribeck is None else model.stribeck.numpy()
        self._signals = np.ones((len(model.kinds), joints))
        self._out = np.zeros((joints, model.count))

    def __call__(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Regressor (J, P) of a state, (J,) each; the array is overwritten by the next call."""
        forces, moments, about, axes = self._chain.wrenches(q, dq, ddq)
        rigid = self._model.rigid
        rows = axes @ moments + about @ forces
        np.multiply(rows.take(self._columns, 1), self._acts, out=self._out[:, :rigid])
        self._fill(dq, ddq)
        self._out[self._joint, self._place] = self._signals[self._term, self._joint]
        return self._out

    def _fill(self, dq: Array, ddq: Array) -> None:
        sign = np.tanh(dq / self._model.terms.sign_width)
        for row, kind in zip(self._signals, self._model.kinds):
            if kind == "rotor_inertia":
                row[:] = ddq
            elif kind == "viscous":
                row[:] = dq
            elif kind == "coulomb":
                row[:] = sign
            elif kind == "stribeck" and self._stribeck is not None:
                row[:] = sign * np.exp(-((dq / self._stribeck) ** 2))


class _Chain:
    """Motion of an arm's links and the wrenches of their ten parameters, in the world frame."""

    def __init__(self, arm: Arm) -> None:
        joints = arm.joints
        fixed, axis = arm.rotation.numpy(), arm.axis.numpy()
        slides = arm.prismatic.numpy()
        k = skew(axis)
        turns = ~slides[:, None, None]
        self._still = fixed @ np.where(turns, np.eye(3) + k @ k, np.eye(3))
        self._sine, self._cosine = np.where(turns, fixed @ k, 0.0), np.where(turns, -fixed @ k @ k, 0.0)
        self._slide = np.where(slides[:, None], (fixed @ axis[..., None])[..., 0], 0.0)
        self._shift, self._axis = arm.translation.numpy(), axis[..., None]
        self._sliding = slides.astype(float)[:, None]
        self._turning = 1 - self._sliding
        self._any_slide = bool(slides.any())
        self._up = -arm.gravity.numpy()
        self._frames = np.empty((joints + 1, 3, 3))
        self._frames[0] = np.eye(3)
        self._before = np.zeros((2, joints, 3))  # turn and turning acceleration of the link before

    def wrenches(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, Array, Array]:
        """Forces and moments about the world's origin, (3, 10 J), of unit link parameters; about and axes.

        Joint j's torque is ``axes[j] @ moments + about[j] @ forces``, with both (J, 3).
        """
        frames, before = self._frames, self._before
        local = self._still + self._sine * np.sin(q)[:, None, None] + self._cosine * np.cos(q)[:, None, None]
        for i in range(len(q)):
            np.dot(frames[i], local[i], out=frames[i + 1])
        own = frames[1:]
        shift = self._shift + self._slide * q[:, None] if self._any_slide else self._shift
        step = (frames[:-1] @ shift[..., None])[..., 0]
        z = (own @ self._axis)[..., 0]
        origin = step.cumsum(0)
        rate, kick = z * dq[:, None], z * ddq[:, None]
        turn = (self._turning * rate).cumsum(0)
        before[0, 1:] = turn[:-1]
        coriolis = cross(before[0], rate)
        turning = (self._turning * (kick + coriolis)).cumsum(0)
        before[1, 1:] = turning[:-1]
        pull = cross(before[1], step) + cross(before[0], cross(before[0], step))
        if self._any_slide:
            pull += self._sliding * (kick + 2 * coriolis)
        speed = np.stack([turn, turning, pull.cumsum(0) + self._up], 1) @ own
        force, moment = _link_wrenches(speed)
        force = own @ force
        moment = own @ moment + skew(origin) @ force
        about = self._sliding * z - self._turning * cross(z, origin)
        flat = (3, 10 * len(q))
        axes = self._turning * z
        return force.swapaxes(0, 1).reshape(flat), moment.swapaxes(0, 1).reshape(flat), about, axes


def _link_wrenches(motion: Array) -> tuple[Array, Array]:
    """Force and moment of each link's ten parameters, (J, 3, 10) each, from its own motion (J, 3, 3)."""
    turn, turning, pull = motion[:, 0], motion[:, 1], motion[:, 2]
    spin = skew(turn)
    twice = spin @ np.concatenate([spin, inertia(turn)], 2)
    force, moment = np.zeros((len(turn), 3, 10)), np.zeros((len(turn), 3, 10))
    force[:, :, 0] = pull
    force[:, :, 1:4] = skew(turning) + twice[:, :, :3]
    moment[:, :, 1:4] = -skew(pull)
    moment[:, :, 4:] = inertia(turning) + twice[:, :, 3:]
    return force, moment


def _linear(table: list[list[str]]) -> Array:
    """Matrix (3, cells) that writes a vector's elements into a table such as [["", "-z"], ["x", ""]]."""
    cells = [cell for row in table for cell in row]
    return np.array([[(cell == x) - float(cell == f"-{x}") for cell in cells] for x in "xyz"], dtype=float)


_SKEW = _linear([["", "-z", "y"], ["z", "", "-x"], ["-y", "x", ""]])
_INERTIA = _linear(
    [["x", "y", "", "z", "", ""], ["", "x", "y", "", "z", ""], ["", "", "", "x", "y", "z"]]
)  # columns in Pinocchio's order: Ixx, Ixy, Iyy, Ixz, Iyz, Izz


def skew(v: Array) -> Array:
    """Matrices (N, 3, 3) with ``skew(v) @ x = v × x`` of vectors (N, 3)."""
    return (v @ _SKEW).reshape(-1, 3, 3)


def inertia(v: Array) -> Array:
    """Matrices (N, 3, 6) whose product with an inertia's six elements is that inertia times v, (N, 3)."""
    return (v @ _INERTIA).reshape(-1, 3, 6)


def cross(a: Array, b: Array) -> Array:
    """Cross products (N, 3); several times as fast as NumPy's for few vectors."""
    return (skew(a) @ b[..., None])[..., 0]
