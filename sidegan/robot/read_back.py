"""Torques of a written arm, by the library that reads its format."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from sidegan.base.arrays import Array
from sidegan.robot.arm import Arm
from sidegan.robot.description import read_description
from sidegan.robot.drives import Drives
from sidegan.robot.model import build
from sidegan.robot.write_mjcf import mujoco_logged


def torque_of_urdf(path: Path, arm: Arm, q: Array, dq: Array, ddq: Array) -> Array:
    """Pinocchio's torque [N·m or N], (S, J), of an arm's URDF at states (S, J), with damping and friction.

    Friction changes its sign with the velocity at once, as the format means it.
    """
    setup = replace(arm.setup, args=None, mount=arm.mount, friction=True)
    description = read_description(path, setup, planning=False)
    model = build(description)
    model.gravity.linear = arm.gravity  # which no URDF states
    data = model.createData()
    rigid = np.array([pin.rnea(model, data, *state).copy() for state in zip(q, dq, ddq)])
    return rigid + (description.drives or Drives.none(arm.joints)).torque(dq, ddq)


def torque_of_mjcf(path: Path, q: Array, dq: Array, ddq: Array) -> Array:
    """MuJoCo's torque [N·m or N], (S, J), of an MJCF at states (S, J), even beyond its joints' ranges."""
    import mujoco

    with mujoco_logged(path.name):
        model = mujoco.MjModel.from_xml_path(str(path))
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
        data = mujoco.MjData(model)
        torque = np.empty_like(q)
        for k, (data.qpos[:], data.qvel[:], data.qacc[:]) in enumerate(zip(q, dq, ddq)):
            mujoco.mj_inverse(model, data)
            torque[k] = data.qfrc_inverse
    return torque
