"""The built-in arms: the LWR IV against the figures it was written from (dynamics: tests/motion).

What a link can be: against mass distributions and Pinocchio's pseudo-inertia.
"""

import numpy as np
import pinocchio as pin
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sidegan.motion.dynamics import RigidBody
from sidegan.robot import (
    built_in_robots,
    inconsistent_links,
    load_robot,
    pseudo_inertia,
)
from tests.chains import random_chain, random_states
from tests.oracle import capsule_geometry
from tests.recording.conftest import real

CAPSULES = [  # end points and radius [m]; the base's from the world, 0.01 m below its own frame
    [-0.0173, 0, 0.0430, 0, 0, 0.0462, 0.0887],
    [0.0001, 0.0323, 0.2087, -0.0003, 0.0002, 0.0410, 0.0649],
    [0, -0.0001, 0.0338, 0, 0.0324, 0.2000, 0.0652],
    [0, 0.0323, 0.2085, -0.0002, 0, 0.0412, 0.0649],
    [0, 0.0321, 0.2000, 0, 0, 0.0336, 0.0650],
    [0, 0, 0.0335, 0, 0.0511, 0.1966, 0.0622],
    [0, 0.0072, 0, 0, -0.0083, 0.0001, 0.0712],
    [0, 0, -0.0185, 0, 0, -0.0185, 0.0401],
]


def test_the_lwr_is_stacked_along_z_with_axes_that_alternate(arm):
    height = [0.12, 0.20, 0.20, 0.20, 0.20, 0.19, 0.078]
    np.testing.assert_allclose(arm.translation, [[0, 0, z] for z in height], rtol=0, atol=1e-8)
    assert torch.equal(arm.rotation, torch.eye(3, dtype=torch.float64).expand(7, 3, 3))
    z, y = [0, 0, 1], [0, 1, 0]
    assert arm.axis.tolist() == [z, [0, -1, 0], z, y, z, [0, -1, 0], z]
    assert not arm.prismatic.any()
    data = (model := pin.buildModelFromUrdf(str(arm.urdf))).createData()
    pin.forwardKinematics(model, data, np.zeros(7))
    np.testing.assert_allclose(data.oMi[7].act(arm.tip.numpy()), [0, 0, 1.188], atol=1e-12)


def test_inertias_of_the_lwr_are_those_of_the_table(arm):
    figures = np.loadtxt(real("kuka_lwr4/inertial_parameters.csv"), delimiter=",", skiprows=1)[:, 1:]
    np.testing.assert_allclose(arm.inertial_parameters, figures, rtol=0, atol=1e-12)


def test_capsules_of_the_lwr_are_those_of_the_table_and_pinocchio_sees_the_same(arm):
    capsules, distances = arm.capsules, []
    found = torch.cat([capsules.a, capsules.b, capsules.radius[:, None]], 1)
    np.testing.assert_allclose(found, CAPSULES, rtol=0, atol=1e-14)
    assert capsules.link.tolist() == [-1, 0, 1, 2, 3, 4, 5, 6]
    assert capsules.names == ("base", *(f"link_{i}" for i in range(1, 8)))
    model = pin.buildModelFromUrdf(str(arm.urdf))
    theirs = pin.buildGeomFromUrdf(model, str(arm.urdf), pin.GeometryType.COLLISION)
    for geometry in (theirs, capsule_geometry(arm)):
        geometry.addAllCollisionPairs()
        data, places = model.createData(), geometry.createData()
        for q in np.random.default_rng(1).uniform(-2, 2, (20, 7)):
            pin.computeDistances(model, data, geometry, places, q)
            distances.append([result.min_distance for result in places.distanceResults])
    theirs, ours = np.array(distances).reshape(2, -1)
    apart = theirs > 0  # a pair that touches is known less exactly: its distance is a depth
    np.testing.assert_allclose(ours[apart], theirs[apart], atol=1e-6)  # m


def test_torque_limits_of_planar2_are_generous(planar):
    q, dq, ddq = random_states(planar, 500)
    assert (RigidBody(planar).torque(q, dq, 2 * ddq).abs() < planar.torque_limit).all()


@pytest.mark.parametrize("name", built_in_robots())
def test_built_in_arms_are_consistent(name):
    assert inconsistent_links(load_robot(name)) == []


def test_a_flat_plate_is_consistent():
    plate = torch.tensor([[1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.02, 0.0, 0.0, 0.03]], dtype=torch.float64)
    assert inconsistent_links(random_chain(1, 0)[0], plate) == []


def test_pseudo_inertia_is_pinocchios():
    arm, _ = random_chain(4, 0)
    for mine, row in zip(pseudo_inertia(arm.inertial_parameters), arm.inertial_parameters):
        theirs = pin.Inertia.FromDynamicParameters(row.numpy()).toPseudoInertia().toMatrix()
        np.testing.assert_allclose(mine, theirs, atol=1e-12)


@given(st.integers(0, 2**31), st.integers(4, 9), st.sampled_from([0.0, 0.1, 1.0, 5.0]))
def test_consistent_means_a_positive_definite_pseudo_inertia(seed, count, beside):
    """Of masses at points, which exist by construction, and of what is beside these."""
    random = np.random.default_rng(seed)
    mass, place = random.uniform(0.1, 2.0, count), random.normal(size=(count, 3))
    points = sum(pin.Inertia(m, p, np.zeros((3, 3))).toDynamicParameters() for m, p in zip(mass, place))
    link = torch.from_numpy(points + beside * random.normal(size=10))[None]
    definite = bool((torch.linalg.eigvalsh(pseudo_inertia(link)) > 0).all())
    assert (inconsistent_links(random_chain(1, 0)[0], link) == []) == definite and (definite or beside)
