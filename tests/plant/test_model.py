"""MuJoCo's inverse dynamics are Pinocchio's."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.plant import mujoco_model
from sidegan.robot import built_in_robots, load_robot
from tests.chains import random_states
from tests.oracle import chain_model


def inverse_dynamics(model, q, dq, ddq):
    """MuJoCo's inverse dynamics [N·m], (S, J), of states (S, J)."""
    data = mujoco.MjData(model)
    torques = []
    for position, velocity, acceleration in zip(q.numpy(), dq.numpy(), ddq.numpy()):
        data.qpos[:], data.qvel[:], data.qacc[:] = position, velocity, acceleration
        mujoco.mj_inverse(model, data)
        torques.append(torch.from_numpy(data.qfrc_inverse.copy()))
    return torch.stack(torques)


@pytest.mark.parametrize("name", built_in_robots())
def test_inverse_dynamics_are_pinocchios(name):
    arm = load_robot(name)
    states = random_states(arm, 200)
    torques = inverse_dynamics(mujoco_model(arm), *states)
    model = chain_model(arm)
    data = model.createData()
    for torque, *state in zip(torques, *(x.numpy() for x in states)):
        np.testing.assert_allclose(torque, pin.rnea(model, data, *state), rtol=0, atol=1e-9)  # N·m
