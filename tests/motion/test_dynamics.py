"""Rigid-body dynamics: Pinocchio as the oracle, linearity in the parameters as the law."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sidegan.base.threads import on_threads
from sidegan.motion.dynamics import BaseParameters, RigidBody
from tests.chains import random_chain, random_states
from tests.motion.conftest import CHAINS, close
from tests.oracle import pinocchio_torque


@pytest.mark.parametrize("chain", [None, *CHAINS])
def test_dynamics_agree_with_pinocchio(chain, arm):
    arm, model = random_chain(*chain) if chain else (arm, pin.buildModelFromUrdf(str(arm.urdf)))
    states = random_states(arm, 40, chain[1]) if chain else random_states(arm, 1000)
    body, data, torque = RigidBody(arm), model.createData(), pinocchio_torque(model, *states)
    regressor = [pin.computeJointTorqueRegressor(model, data, *row).copy() for row in zip(*states)]
    regressor = np.reshape(regressor, (*states[0].shape, -1))
    scale = np.abs(regressor).max()
    np.testing.assert_allclose(body.regressor(*states), regressor, atol=1e-13 * scale, rtol=0)
    np.testing.assert_allclose(body.torque(*states), torque, atol=1e-12 * scale, rtol=0)


def test_planar_arm_has_the_textbooks_base_parameters(planar, arm):
    """Moments about each joint, and the second link's mass as if it sat at the elbow."""
    base = RigidBody(planar).base
    assert base.names == ("mx1", "mz1", "Iyy1", "mx2", "mz2", "Iyy2")
    m1, m2, l1 = 3.0, 2.0, 0.4
    first, second = 0.045 + m1 * 0.18**2 + m2 * l1**2, 0.028 + m2 * 0.16**2
    values = np.array([0.0, m1 * 0.18 + m2 * l1, first, 0.0, m2 * 0.16, second])
    np.testing.assert_allclose(base.values, values, atol=1e-10, rtol=0)
    assert RigidBody(arm).parameters_count == 43  # as the literature says of the LWR


@pytest.mark.parametrize("apart", [1e-2, 1e-3, 1e-4])
def test_parameters_with_small_effects_are_base_parameters(planar, apart):
    """Two parallel, upright axes, hardly apart: the second link's centre is felt through that alone."""
    upright = replace(planar, gravity=9.81 * planar.axis[0], translation=planar.translation * 0)
    assert RigidBody(upright).base.names == ("Iyy1", "Iyy2")
    shift = planar.translation * np.array([[0.0], [1.0]])
    near = replace(upright, translation=apart * shift)
    assert RigidBody(near).base.names == ("Iyy1", "mx2", "mz2", "Iyy2")


@pytest.mark.parametrize("digits", [3, 4, 6])
def test_rounded_right_angles_add_no_base_parameter(planar, digits):
    """Upright but for what rounding leaves: weights that the tilt shows are no parameters of the joint."""
    upright = replace(planar, gravity=9.81 * planar.axis[0])
    exact = RigidBody(upright).base
    tilt = round(math.pi / 2, digits) - math.pi / 2
    cosine, sine = math.cos(tilt), math.sin(tilt)
    turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    for rotation in (turn, turn.T):
        tilted = replace(upright, gravity=rotation @ upright.gravity)
        base = RigidBody(tilted).base
        if digits == 3:  # a fifth of a millirad is no rounding: it is felt
            assert len(base.names) == len(exact.names) + 2
            continue
        assert base.names == exact.names
        np.testing.assert_allclose(base.values, exact.values, rtol=1e-4, atol=1e-6)
        states = random_states(tilted, 100, seed=1)
        torque = RigidBody(tilted).base_regressor(*states) @ base.values
        np.testing.assert_allclose(torque, RigidBody(tilted).torque(*states), rtol=0, atol=2e-3)


@pytest.mark.parametrize("chain", [None, *CHAINS])
def test_base_parameters_explain_the_full_regressor(chain, arm):
    arm = random_chain(*chain)[0] if chain else arm
    body, states = RigidBody(arm), random_states(arm, 300, seed=9)
    full, base = body.regressor(*states), body.base_regressor(*states)
    close(base @ body.base.mapping, full, 1e-10)
    scale = float(np.abs(full).max())
    np.testing.assert_allclose(base @ body.base.values, body.torque(*states), atol=1e-10 * scale, rtol=0)
    own = body.base.mapping[:, body.base.columns]
    np.testing.assert_allclose(own, np.eye(len(own)), atol=1e-12)


def test_base_parameters_do_not_depend_on_the_threads_of_the_process(arm):
    base = BaseParameters.of(arm)
    with on_threads(2):
        other = BaseParameters.of(replace(arm))
    assert other is not base
    for name in ("columns", "mapping", "values", "subspace"):
        assert np.array_equal(getattr(base, name), getattr(other, name)), name  # the same computation


@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 129, 2001])
def test_a_regressor_does_not_depend_on_how_many_states_there_are(arm, count):
    body, states = RigidBody(arm), random_states(arm, 2001)
    whole, some = body.regressor(*states), body.regressor(*(x[:count] for x in states))
    np.testing.assert_allclose(some, whole[:count], rtol=1e-13, atol=1e-12)
