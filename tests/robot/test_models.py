"""The built-in arms: the LWR IV against the figures it was written from (dynamics: tests/motion).

What a link can be: against mass distributions and Pinocchio's pseudo-inertia.
"""

import numpy as np
import pinocchio as pin
from hypothesis import given
from hypothesis import strategies as st

from sidegan.robot import inconsistent_links, pseudo_inertia
from tests.chains import random_chain
from tests.recording.conftest import real


def test_inertias_of_the_lwr_are_those_of_the_table(arm):
    figures = np.loadtxt(real("kuka_lwr4/inertial_parameters.csv"), delimiter=",", skiprows=1)[:, 1:]
    np.testing.assert_allclose(arm.inertial_parameters, figures, rtol=0, atol=1e-12)


def test_a_flat_plate_is_physically_consistent():
    plate = np.array([[1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.02, 0.0, 0.0, 0.03]], dtype=float)
    assert inconsistent_links(random_chain(1, 0)[0], plate) == []


def test_pseudo_inertia_is_pinocchios():
    arm, _ = random_chain(4, 0)
    for mine, row in zip(pseudo_inertia(arm.inertial_parameters), arm.inertial_parameters):
        theirs = pin.Inertia.FromDynamicParameters(row).toPseudoInertia().toMatrix()
        np.testing.assert_allclose(mine, theirs, atol=1e-12)


@given(st.integers(0, 2**31), st.integers(4, 9), st.sampled_from([0.0, 0.1, 1.0, 5.0]))
def test_consistent_means_a_positive_definite_pseudo_inertia(seed, count, beside):
    """Of masses at points, which exist by construction, and of what is beside these."""
    random = np.random.default_rng(seed)
    mass, place = random.uniform(0.1, 2.0, count), random.normal(size=(count, 3))
    points = sum(pin.Inertia(m, p, np.zeros((3, 3))).toDynamicParameters() for m, p in zip(mass, place))
    link = (points + beside * random.normal(size=10))[None]
    definite = bool((np.linalg.eigvalsh(pseudo_inertia(link)) > 0).all())
    assert (inconsistent_links(random_chain(1, 0)[0], link) == []) == definite
    if not beside:
        assert definite
