"""Excitation and information: the full YᵀY and closed forms as oracles."""

import math

import numpy as np
import pytest

from sidegan.design.excitation import Excitation, condition_of, excite, information_of
from sidegan.motion.dynamics import RigidBody
from tests.chains import random_chain

from .conftest import semidefinite, trajectories


@pytest.mark.parametrize("joints", [0, 1, 2, 4])
def test_spectrum_trace_and_diagonal_are_those_of_the_full_regressor(joints, arm):
    arm = random_chain(joints, 0)[0] if joints else arm
    body, (trajectory, c) = RigidBody(arm), trajectories(arm.joints)
    excitation = excite(body, trajectory, c)
    y = body.regressor(*trajectory.roll_out(c, trajectory.grid(80))[1:]).reshape(len(c), -1, 10 * arm.joints)
    gram, p = y.mT @ y / 80, body.parameters_count
    eigenvalues, diagonal = np.linalg.eigvalsh(gram), np.linalg.diagonal(gram)
    noise = 1e-13 * eigenvalues[:, -1:]
    assert (np.abs(eigenvalues[:, :-p]) <= noise).all()
    assert (np.abs(excitation.spectrum - eigenvalues[:, -p:]) <= noise + 1e-9 * eigenvalues[:, -p:]).all()
    np.testing.assert_allclose(excitation.spectrum.sum(1), diagonal.sum(1))
    np.testing.assert_allclose(excitation.diagonal, diagonal[:, body.base.columns])
    for noise in (None, np.linspace(0.5, 2.5, arm.joints).tolist()):
        rows = y if noise is None else y / np.tile(noise, 80)[:, None]
        expected = np.linalg.eigvalsh(rows.mT @ rows / 80)[:, -p:]
        found = np.linalg.eigvalsh(information_of(body, trajectory, c, noise=noise))
        assert (np.abs(found - expected) <= 1e-9 * expected + 1e-12 * expected[:, -1:]).all()


def test_the_condition_number_is_numpys_or_infinite_if_unexcited():
    for matrix in semidefinite(0, 5):
        assert condition_of(matrix) == pytest.approx(float(np.linalg.cond(matrix)), rel=1e-6)
    for matrix in (np.ones((3, 3)), np.zeros((3, 3))):
        assert condition_of(matrix) == math.inf


def test_fitness_is_the_ratio_of_largest_to_smallest():
    spectrum = np.array([[2.0, 3.0, 8.0], [1e-9, 1.0, 1.0]])
    diagonal = np.array([[5.0, 1.0, 2.0], [7.0, 3.5, 7.0]])
    excitation = Excitation(spectrum, diagonal)
    np.testing.assert_allclose(excitation.eigenvalue_fitness, [4.0, 1e9])
    assert excitation.diagonal_fitness.tolist() == [5.0, 2.0]
    for low in (0.0, -1e-18, 4e-16):  # an unexcited direction
        spectrum = np.array([[low, 0.5, 1.0]])
        assert Excitation(spectrum, spectrum).eigenvalue_fitness.item() == math.inf
