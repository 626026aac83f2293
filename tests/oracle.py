"""An arm as Pinocchio has it, and torques of Pinocchio and MuJoCo, to check ours against."""

import runpy

import coal
import mujoco
import numpy as np
import pinocchio as pin

from sidegan.base.arrays import Array
from sidegan.robot import Arm


def chain_model(arm: Arm) -> pin.Model:
    """Pinocchio's model of an arm."""
    model = pin.Model()
    model.gravity.linear = arm.gravity
    for i, name in enumerate(arm.joint_names):
        kind = pin.JointModelPrismaticUnaligned if arm.prismatic[i] else pin.JointModelRevoluteUnaligned
        placement = pin.SE3(arm.rotation[i], arm.translation[i])
        model.addJoint(i, kind(arm.axis[i]), placement, name)
        inertia = pin.Inertia.FromDynamicParameters(arm.inertial_parameters[i])
        model.appendBodyToJoint(i + 1, inertia, pin.SE3.Identity())
    return model


def pinocchio_torque(model: pin.Model, *states: Array) -> Array:
    """Pinocchio's inverse dynamics, (S, J), at positions, velocities and accelerations, (S, J) each."""
    data = model.createData()
    return np.array([pin.rnea(model, data, *state).copy() for state in zip(*states)])


def mujoco_torque(model: mujoco.MjModel, *states: Array) -> Array:
    """MuJoCo's inverse dynamics, (S, J), at positions, velocities and accelerations, (S, J) each."""
    data = mujoco.MjData(model)
    torques = []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(*states):
        mujoco.mj_inverse(model, data)
        torques.append(data.qfrc_inverse.copy())
    return np.array(torques)


def capsule_geometry(arm: Arm) -> pin.GeometryModel:
    """An arm's C capsules as Pinocchio's collision geometry, in order and without collision pairs."""
    geometry, shapes, z = pin.GeometryModel(), arm.capsules, np.array([0.0, 0.0, 1.0])
    for owner, link, a, b, radius in zip(shapes.owners, shapes.link, shapes.a, shapes.b, shapes.radius):
        along = b - a
        turn = pin.Quaternion.FromTwoVectors(z, along if along.any() else z).matrix()
        placement = pin.SE3(turn, ((a + b) / 2))
        capsule = coal.Capsule(float(radius), float(np.linalg.norm(along)))
        geometry.addGeometryObject(pin.GeometryObject(owner, int(link) + 1, placement, capsule))
    return geometry


def python_class(folder):
    """The class that an identification left in its folder."""
    return runpy.run_path(str(folder / "model.py"))["ArmDynamics"]()
