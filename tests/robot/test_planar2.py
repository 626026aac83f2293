"""The planar arm against the textbook's closed form."""

import numpy as np
import pinocchio as pin
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sidegan.robot import load_robot, pinocchio_model

ARM = load_robot("planar2")
MODEL = pinocchio_model(ARM)
LENGTH, CENTRE, MASS, INERTIA, G = 0.4, (0.18, 0.16), (3.0, 2.0), (0.045, 0.028), 9.81


def closed_form(q, dq, ddq):
    """Torque [N·m], (2,), of the planar elbow arm, angles from the vertical (Spong et al., section 7.4)."""
    (m1, m2), (c1, c2), (i1, i2) = MASS, CENTRE, INERTIA
    cross = m2 * LENGTH * c2
    d22 = m2 * c2**2 + i2
    d12 = d22 + cross * np.cos(q[1])
    d11 = m1 * c1**2 + i1 + m2 * LENGTH**2 + d22 + 2 * cross * np.cos(q[1])
    h = -cross * np.sin(q[1])
    fall2 = -m2 * G * c2 * np.sin(q[0] + q[1])
    fall1 = -(m1 * c1 + m2 * LENGTH) * G * np.sin(q[0]) + fall2
    return np.array(
        [
            d11 * ddq[0] + d12 * ddq[1] + h * dq[1] * (2 * dq[0] + dq[1]) + fall1,
            d12 * ddq[0] + d22 * ddq[1] - h * dq[0] ** 2 + fall2,
        ]
    )


@given(arrays(np.float64, (3, 2), elements=st.floats(-10, 10)))
def test_torque_is_the_textbooks(state):
    torque = pin.rnea(MODEL, MODEL.createData(), *state)
    np.testing.assert_allclose(torque, closed_form(*state), rtol=1e-12, atol=1e-10)  # N·m


def test_moves_in_a_vertical_plane():
    assert ARM.axis.tolist() == [[0, 1, 0], [0, 1, 0]]
    assert ARM.gravity.tolist() == [0, 0, -9.81]
    assert ARM.tip.tolist() == [0, 0, LENGTH]


def test_torque_limits_are_generous():
    draw = torch.rand(500, 3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * 2 - 1
    q, dq, ddq = draw[:, 0] * ARM.position_upper, draw[:, 1] * ARM.velocity_limit, draw[:, 2] * 10.0
    torques = [pin.rnea(MODEL, MODEL.createData(), *state) for state in torch.stack([q, dq, ddq], 1).numpy()]
    assert (np.abs(torques) < ARM.torque_limit.numpy()).all()
