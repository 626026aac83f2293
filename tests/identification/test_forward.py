"""Forward simulation by MuJoCo, against Pinocchio's forward dynamics and against errors put in on purpose."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.identification.forward import forward_errors
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import Segment
from sidegan.robot import Drives, chain_model
from tests.recording.conftest import states

NOTHING = torch.zeros(2, dtype=torch.float64)


@pytest.fixture(scope="module")
def segment(planar):
    """20 s of a motion with friction and rotors, at 100 Hz."""
    time = np.arange(2000) * 0.01
    q, v, a = states(time)
    torque = RigidBody(planar).torque(q, v, a) + 0.5 * v + 0.2 * a + 0.3 * torch.tanh(v / 0.01) + 0.7
    return Segment(torch.from_numpy(time), q, v, a, torque, torch.tanh(v / 0.01))


def test_the_right_model_follows_and_a_wrong_one_does_not(planar, segment):
    *own, offset = (torch.full((2,), x, dtype=torch.float64) for x in (0.5, 0.3, 0.2, 0.7))
    right = forward_errors(planar, Drives(*own), offset, [segment])
    heavy = replace(planar, inertial_parameters=1.2 * planar.inertial_parameters)
    wrong = forward_errors(heavy, Drives(*own), offset, [segment])
    assert right.free.shape == (20, 2) and right.starts == 19
    assert (right.free[-1] < 0.02).all() and (wrong.free[-1] > 5 * right.free[-1]).all()
    assert (wrong.held[-1] < 0.7 * wrong.free[-1]).all()
    assert float(wrong.free[-1].max() / wrong.free[4].max()) > 5  # it grows
    assert right.horizon[0] == pytest.approx(0.05) and right.horizon[-1] == pytest.approx(1.0)


def test_mujoco_and_pinocchio_go_the_same_way(planar, segment):
    light = replace(planar, inertial_parameters=0.8 * planar.inertial_parameters)
    short = Segment(*(x[300:365] for x in segment))
    found = forward_errors(light, Drives.none(2), NOTHING, [short], longest=0.6)
    model = chain_model(light)
    data, q, v = model.createData(), short.position[0].numpy().copy(), short.velocity[0].numpy().copy()
    time, torque = short.time.numpy(), short.torque.numpy()
    off, step = [], 1e-4
    for k in range(6000):
        now = short.time[0].item() + k * step
        v = v + step * pin.aba(model, data, q, v, np.array([np.interp(now, time, x) for x in torque.T]))
        q = q + step * v
        off.append(np.abs(q - [np.interp(now + step, time, x) for x in short.position.numpy().T]))
    expected = np.array(off)[299::300]
    assert expected[-1].max() > 0.1
    np.testing.assert_allclose(found.free.numpy(), expected, rtol=0.03, atol=6e-3)


def test_what_is_too_short_tells_nothing(planar, segment):
    assert forward_errors(planar, Drives.none(2), NOTHING, [Segment(*(x[:50] for x in segment))]) is None
