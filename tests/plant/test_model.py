"""MuJoCo's inverse dynamics are Pinocchio's and ours."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.motion.dynamics import RigidBody
from sidegan.plant import IDEAL, mujoco_model
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


@pytest.mark.parametrize("joints", [1, 2, 3, 6, 9])
def test_inverse_dynamics_of_any_chain_are_ours(chain, joints):
    arm = chain(joints, 0)
    states = random_states(arm, 50)
    torques = inverse_dynamics(mujoco_model(arm), *states)
    torch.testing.assert_close(torques, RigidBody(arm).torque(*states), rtol=0, atol=1e-9)


def test_rotors_and_viscous_friction_add_to_the_rigid_body(planar):
    settings = replace(IDEAL, viscous=[2.0, 3.0], rotor_inertia=[0.5, 0.25])
    q, dq, ddq = random_states(planar, 50)
    torques = inverse_dynamics(mujoco_model(planar, settings), q, dq, ddq)
    added = dq * torch.tensor([2.0, 3.0]) + ddq * torch.tensor([0.5, 0.25])
    torch.testing.assert_close(torques, RigidBody(planar).torque(q, dq, ddq) + added, rtol=0, atol=1e-9)
