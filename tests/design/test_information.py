"""Information has the spectrum of the full regressor, weighted by noise."""

import math

import numpy as np
import pytest

from sidegan.design.information import condition_of, information_of
from sidegan.motion.dynamics import RigidBody
from tests.chains import random_chain

from .conftest import semidefinite, trajectories


@pytest.mark.parametrize("joints", [0, 1, 3])
@pytest.mark.parametrize("equal", [True, False])
def test_information_has_the_spectrum_of_the_full_regressor(joints, equal, arm):
    arm = random_chain(joints, 0)[0] if joints else arm
    body, (trajectory, c) = RigidBody(arm), trajectories(arm.joints)
    noise = np.linspace(0.5, 2.5, arm.joints)
    information = information_of(body, trajectory, c, 40, None if equal else noise.tolist())
    weights = np.ones_like(noise) if equal else noise**-2
    y = body.regressor(*trajectory.roll_out(c, trajectory.grid(40))[1:])
    full = np.einsum("j,btjp,btjq->bpq", weights, y, y) / 40
    expected = np.linalg.eigvalsh(full)[:, -body.parameters_count :]
    found = np.linalg.eigvalsh(information)
    assert (np.abs(found - expected) <= 1e-9 * expected + 1e-12 * expected[:, -1:]).all()


def test_the_condition_number_is_numpys_or_infinite_if_unexcited():
    for matrix in semidefinite(0, 5):
        assert condition_of(matrix) == pytest.approx(float(np.linalg.cond(matrix)), rel=1e-6)
    for matrix in (np.ones((3, 3)), np.zeros((3, 3))):
        assert condition_of(matrix) == math.inf
