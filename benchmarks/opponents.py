"""Opponents of sidegan, as one would write them; its row skips where FIGAROH is absent."""

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mujoco import rollout

from sidegan.plant import Plant
from sidegan.plant.model import mujoco_model
from sidegan.robot import Arm
from sidegan.validity import Constraints
from tests.oracle import capsule_geometry, chain_model

Array = np.ndarray
State = Sequence[Array]  # position, velocity and acceleration, (J,) or (S, J) each

_CERTAIN = 1e6  # variance of parameters before any sample


class Pinocchio:
    """Regressors, torques, estimates and checks of an arm by Pinocchio, NumPy and coal."""

    def __init__(self, constraints: Constraints) -> None:
        self.model = chain_model(constraints.arm)
        self.data = self.model.createData()
        self.pool = pin.ModelPool(self.model, 2)
        self.columns = constraints.body.base.columns
        self.geometry = capsule_geometry(constraints.arm)
        for first, second in constraints.pairs.tolist():
            self.geometry.addCollisionPair(pin.CollisionPair(first, second))
        self.shapes = self.geometry.createData()
        self.shape_pool = pin.GeometryPool(self.model, self.geometry, 2)

    def regressor(self, state: State) -> Array:
        """Base regressor (J, p) of a state."""
        return pin.computeJointTorqueRegressor(self.model, self.data, *state)[:, self.columns]

    def gram(self, states: Sequence[State]) -> Array:
        """YᵀY (p, p) of a trajectory."""
        y = np.concatenate([self.regressor(state) for state in states])
        return y.T @ y / len(states)

    def torque(self, threads: int, columns: State) -> Array:
        """Torques (S, J) of states, (J, S) each, by the library's own threads."""
        return pin.rneaInParallel(threads, self.pool, *columns).T

    def touch(self, threads: int, positions: Array) -> Array:
        """Whether links touch, (S,), at positions (J, S), by the library's own threads."""
        return pin.computeCollisionsInParallel(threads, self.shape_pool, positions, True)

    def check(self, states: Sequence[State]) -> None:
        """Torques and distances at samples, with nothing proven between them."""
        for q, dq, ddq in states:
            pin.rnea(self.model, self.data, q, dq, ddq)
            pin.computeDistances(self.model, self.data, self.geometry, self.shapes, q)

    def estimate(self, states: Sequence[State], torques: Array) -> Array:
        """Base parameters (p,) by recursive least squares in its covariance form, one gain per sample."""
        count = len(self.columns)
        covariance = _CERTAIN * np.eye(count)
        estimate = np.zeros(count)
        for state, torque in zip(states, torques):
            y = self.regressor(state)
            carried = covariance @ y.T
            gain = np.linalg.solve(np.eye(len(y)) + y @ carried, carried.T).T
            estimate = estimate + gain @ (torque - y @ estimate)
            covariance = covariance - gain @ carried.T
            covariance = (covariance + covariance.T) / 2  # else rounding makes it diverge
        return estimate


def mujoco_torque(arm: Arm, states: Sequence[State]) -> Callable[[], Array]:
    """Function of the torques of states, (S, J), by ``mj_inverse``."""
    model = mujoco_model(arm)
    data = mujoco.MjData(model)

    def torque() -> Array:
        found = []
        for data.qpos[:], data.qvel[:], data.qacc[:] in states:
            mujoco.mj_inverse(model, data)
            found.append(data.qfrc_inverse.copy())
        return np.array(found)

    return torque


def mujoco_execute(plant: Plant, threads: int, start: Array, targets: Array) -> Array:
    """Positions (B, T, J) after each step of servos with given targets (B, T, J), all arms at once."""
    joints = targets.shape[2]
    data = [mujoco.MjData(plant.model) for _ in range(threads)]
    first = np.concatenate([np.zeros((len(start), 1)), start], 1)  # time, positions and velocities
    states, _ = rollout.rollout(plant.model, data, first, targets)
    return states[:, :, 1 : 1 + joints]


def figaroh_regressor(arm: Arm, columns: Array, states: State) -> Callable[[], Array]:
    """Function of columns of the regressor, (S, J, p), of states (S, J), by FIGAROH; a skip without it."""
    pytest.importorskip("figaroh", reason="FIGAROH is not installed")
    from figaroh.tools.qrdecomposition import build_baseRegressor
    from figaroh.tools.regressor import build_regressor_basic
    from figaroh.tools.robot import Robot

    robot = Robot(str(arm.urdf), package_dirs="")
    joints = list(range(arm.joints))
    settings = {"act_idxq": joints, "act_idxv": joints, "is_joint_torques": True}

    def regressor() -> Array:
        y = build_baseRegressor(build_regressor_basic(robot, *states, settings), columns)
        return y.reshape(arm.joints, len(states[0]), -1).swapaxes(0, 1)

    return regressor
