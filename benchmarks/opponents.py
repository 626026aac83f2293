"""Opponents of sidegan, as one would write them; rows skip where FIGAROH or frax is absent."""

import sys
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mujoco import rollout

from sidegan.identification import Measurements
from sidegan.plant import Plant
from sidegan.plant.model import mujoco_model
from sidegan.robot import Arm
from sidegan.validity import Constraints
from tests.oracle import capsule_geometry, chain_model

Array = np.ndarray
State = Sequence[Array]  # position, velocity and acceleration, (J,) each

_CERTAIN = 1e6  # variance of parameters before any sample
_TURN = np.array([np.cos(0.4), np.sin(0.4)])  # of inertias with products
# Mass, centre, moments about it and axis of a turn by which ten bodies span all inertial parameters.
_BODIES: list[tuple[float, Array, list[float], Array | None]] = [
    (1.0, np.zeros(3), [1.0, 1.0, 1.0], None),
    (2.0, np.zeros(3), [1.0, 1.0, 1.0], None),
    *((1.0, axis, [1.0, 1.0, 1.0], None) for axis in np.eye(3)),
    (1.0, np.zeros(3), [2.0, 1.0, 1.5], None),
    (1.0, np.zeros(3), [1.0, 2.0, 1.5], None),
    *((1.0, np.zeros(3), [1.0, 2.0, 2.5], axis) for axis in np.eye(3)),
]


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


def pinocchio_torque(arm: Arm, training: Measurements, validation: Measurements) -> Array:
    """Torques (S, J) of validation, by least squares with viscous and Coulomb friction."""
    model = chain_model(arm)
    data = model.createData()

    def regressor(samples: Measurements) -> Array:
        """(S, J, 12 J)."""
        rigid = [pin.computeJointTorqueRegressor(model, data, *state) for state in zip(*samples.states)]
        velocity = samples.velocity[:, :, None] * np.eye(arm.joints)
        return np.concatenate([rigid, velocity, np.sign(velocity)], axis=2)

    equations = np.concatenate(regressor(training))
    return regressor(validation) @ np.linalg.lstsq(equations, training.torque.ravel())[0]


class Mujoco:
    """Torques and regressors of an arm by ``mj_inverse``, and its plant by ``rollout``."""

    def __init__(self, arm: Arm) -> None:
        self.own = arm.inertial_parameters
        self.model = mujoco_model(arm)
        self.data = mujoco.MjData(self.model)

    def torque(self, states: Sequence[State]) -> Array:
        """Torques of states, (S, J)."""
        data = self.data
        found = []
        for data.qpos[:], data.qvel[:], data.qacc[:] in states:
            mujoco.mj_inverse(self.model, data)
            found.append(data.qfrc_inverse.copy())
        return np.array(found)

    def regressor(self, states: Sequence[State]) -> Array:
        """Full regressor (S, J, 10 J), from torques with ten other bodies in the place of each link's."""
        before = self.torque(states)
        parts = []
        model = self.model
        for link, own in enumerate(self.own, start=1):
            fields = (model.body_mass, model.body_ipos, model.body_inertia, model.body_iquat)
            kept = [field[link].copy() for field in fields]
            torques, parameters = [], []
            for mass, centre, moments, axis in _BODIES:
                turn = np.array([1.0, 0, 0, 0] if axis is None else [_TURN[0], *(_TURN[1] * axis)])
                for field, value in zip(fields, (mass, centre, moments, turn)):
                    field[link] = value
                turned = pin.Quaternion(*turn).matrix()
                body = pin.Inertia(mass, centre, turned @ np.diag(moments) @ turned.T)
                torques.append(self.torque(states) - before)
                parameters.append(body.toDynamicParameters() - own)
            for field, value in zip(fields, kept):
                field[link] = value
            parts.append(
                np.linalg.solve(parameters, np.reshape(torques, (10, -1))).reshape(10, *before.shape)
            )
        return np.moveaxis(np.concatenate(parts), 0, -1)

    @staticmethod
    def execute(plant: Plant, threads: int, start: Array, targets: Array) -> Array:
        """Positions (B, T, J) after each step of servos with given targets (B, T, J), all arms at once."""
        joints = targets.shape[2]
        data = [mujoco.MjData(plant.model) for _ in range(threads)]
        first = np.concatenate([np.zeros((len(start), 1)), start], 1)  # time, positions and velocities
        states, _ = rollout.rollout(plant.model, data, first, targets)
        return states[:, :, 1 : 1 + joints]


class Figaroh:
    """Base regressors of an arm by FIGAROH, and a trajectory by its optimiser."""

    def __init__(self, arm: Arm) -> None:
        pytest.importorskip("figaroh", reason="FIGAROH is not installed")
        from figaroh.tools.robot import Robot

        self.robot = Robot(str(arm.urdf), package_dirs="")
        joints = list(range(arm.joints))
        self.settings = {"act_idxq": joints, "act_idxv": joints, "is_joint_torques": True}

    def regressor(self, columns: Array, *states: Array) -> Array:
        """Some columns of the regressor, (J S, p), joint by joint, of states (S, J)."""
        from figaroh.tools.qrdecomposition import build_baseRegressor
        from figaroh.tools.regressor import build_regressor_basic

        return build_baseRegressor(build_regressor_basic(self.robot, *states, self.settings), columns)

    def base_columns(self, *states: Array) -> Array:
        """Columns that its decomposition takes as the base, (p,)."""
        from figaroh.identification.parameter import get_standard_parameters
        from figaroh.tools.qrdecomposition import get_baseIndex
        from figaroh.tools.regressor import (
            build_regressor_basic,
            build_regressor_reduced,
            get_index_eliminate,
        )

        y = build_regressor_basic(self.robot, *states, self.settings)
        gone, names = get_index_eliminate(y, get_standard_parameters(self.robot.model, self.settings))
        left = np.delete(np.arange(y.shape[1]), gone)
        return left[list(get_baseIndex(build_regressor_reduced(y, gone), names))]

    def optimise(self, joints: Sequence[str], **changes: Any) -> list[float]:
        """Condition numbers of a trajectory of four cubic splines of 4 s, as IPOPT makes them smaller."""
        pytest.importorskip("cyipopt", reason="IPOPT's bindings are not installed")
        from figaroh.optimal import base_optimal_trajectory as optimal

        class Search(optimal.BaseOptimalTrajectory):  # type: ignore[misc]
            def __init__(search) -> None:  # noqa: N805
                search.robot = self.robot
                search.model = self.robot.model
                search.active_joints = list(joints)
                search.logger = optimal.logger
                search.identif_config = self.settings
                search.trajectory_config = {"n_wps": 5, "t_s": 4.0, "soft_lim": 0.05, "max_attempts": 1000}
                search.trajectory_config |= changes
                search.results = {key: [] for key in ("T_F", "P_F", "V_F", "A_F", "iteration_data")}

            def create_ipopt_problem(search, *words: Any) -> Any:  # noqa: N805
                search.problem = optimal.BaseTrajectoryIPOPTProblem(search, *words)
                return search.problem

        search = Search()
        search.initialize()
        search.solve(1)
        return search.problem.iteration_data["obj_values"]


def figaroh_torque(arm: Arm, training: Measurements, validation: Measurements) -> Array:
    """Torques (S, J) of validation, by FIGAROH's weighted least squares with all terms of its joints."""
    from figaroh.identification.base_identification import BaseIdentification
    from figaroh.tools.qrdecomposition import build_baseRegressor, get_baseIndex
    from figaroh.tools.regressor import build_regressor_basic

    joints = list(range(arm.joints))
    settings = {"act_idxq": joints, "act_idxv": joints, "active_joints": list(arm.joint_names)}
    terms = ("has_friction", "has_actuator_inertia", "has_joint_offset")
    settings |= dict.fromkeys(["is_joint_torques", *terms], True)

    class Identification(BaseIdentification):  # type: ignore[misc]
        def load_param(self, *_: Any) -> None:
            self.identif_config = settings

        def load_trajectory_data(self) -> None:
            names = ("positions", "velocities", "accelerations", "torques")
            self.processed_data = dict(zip(names, (*training.states, training.torque)))
            self.num_samples = len(training)

    model = chain_model(arm)
    found = Identification(SimpleNamespace(model=model, data=model.createData()))
    found.load_trajectory_data()
    found.calculate_full_regressor()
    found.initialize_standard_parameters()
    with redirect_stdout(sys.stderr):
        found.solve(decimate=False, plotting=False, wls=True)
    y = build_regressor_basic(found.robot, *validation.states, settings)
    kept = [name in found.active_parameters for name in found.standard_parameter]
    base = get_baseIndex(found.regressor_reduced, found.active_parameters)
    predicted = build_baseRegressor(y[:, kept], base) @ found.phi_base
    return predicted.reshape(arm.joints, -1).T  # from rows joint by joint


def frax_torque(arm: Arm, folder: Path) -> Any:
    """Torques of batches of states (S, J) by frax, compiled by JAX in double precision; a skip without it."""
    jax = pytest.importorskip("jax", reason="JAX is not installed")
    frax = pytest.importorskip("frax", reason="frax is not installed", exc_type=ImportError)
    jax.config.update("jax_enable_x64", True)
    tree = ET.parse(arm.urdf)
    for link in (element for element in tree.getroot().iter("link") if element.find("inertial") is None):
        inertial = ET.SubElement(link, "inertial")  # frax asks one of the base as well
        ET.SubElement(inertial, "mass", value="1")
        ET.SubElement(inertial, "inertia", ixx="1", iyy="1", izz="1", ixy="0", ixz="0", iyz="0")
    tree.write(folder / "arm.urdf")
    robot = frax.Robot(str(folder / "arm.urdf"))
    gravity = jax.numpy.array([*-arm.gravity, 0, 0, 0])
    batch = jax.jit(jax.vmap(lambda q, dq, ddq: robot.rnea(q, dq, ddq, gravity, None)))
    return lambda *states: batch(*states).block_until_ready()
