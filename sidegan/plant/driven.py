"""An arm in MuJoCo that recorded torques drive, from recorded states on, with or without servos."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sidegan.plant.execute import Plant
from sidegan.plant.model import mujoco_model
from sidegan.plant.settings import IDEAL
from sidegan.robot import Arm, Drives
from sidegan.robot.mujoco_log import mujoco_logged

Array = NDArray[np.float64]


class Run(NamedTuple):
    """What drives the arm for N steps."""

    position: Array  # recorded [rad or m], (N + 1, J); the first is where the arm is let go
    velocity: Array  # recorded [rad/s or m/s], (N + 1, J)
    torque: Array  # over each step [N·m or N], (N, J)


def driven(
    arm: Arm, drives: Drives, runs: Sequence[Run], rate: float, bandwidth: float | None = None
) -> Array:
    """Positions [rad or m] after each step of all runs, (R, N, J), which are of one length.

    Args:
        arm: whose links are physically consistent.
        drives: its friction and rotors.
        runs: recorded motions and torques.
        rate: of their steps [Hz].
        bandwidth: of servos that pull towards the recorded motion [Hz]; None: without.

    Raises:
        RobotError: when a link is not physically consistent, or MuJoCo refuses the arm.
    """
    from mujoco import MjData, mj_stateSize, mjtState, rollout

    friction = {name: x.tolist() for name, x in vars(drives).items()}
    settings, joints = replace(IDEAL, rate=rate, **friction), arm.joints
    strong = replace(arm, torque_limit=torch.full_like(arm.torque_limit, torch.inf))
    servos: tuple[Tensor, Tensor] = (torch.zeros(joints), torch.zeros(joints))
    if bandwidth is not None:
        servos = Plant(strong, replace(settings, bandwidth=[bandwidth])).gains
    model, kp, kd = mujoco_model(strong, settings, *servos), servos[0].numpy(), servos[1].numpy()
    start = np.zeros((len(runs), mj_stateSize(model, mjtState.mjSTATE_FULLPHYSICS)))
    # a state is time, positions, velocities
    start[:, 1 : 1 + 2 * joints] = [np.concatenate([run.position[0], run.velocity[0]]) for run in runs]
    lead = np.divide(kd, kp, out=np.zeros(joints), where=kp > 0)  # a servo's damping acts against all speed
    control = [np.concatenate([q[1:] + dq[1:] * lead, torque], 1) for q, dq, torque in runs]
    both = mjtState.mjSTATE_CTRL.value | mjtState.mjSTATE_QFRC_APPLIED.value
    with mujoco_logged(arm.name):
        states, _ = rollout.rollout(model, MjData(model), start, np.stack(control), control_spec=both)
    return np.asarray(states[:, :, 1 : 1 + joints])
