"""The built-in arms: the LWR IV against the figures it was written from, planar2 against the textbook."""

import os
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sidegan.robot import capsule_geometry, load_robot, pinocchio_model

DATA = Path(os.environ.get("SIDEGAN_DATA", Path(__file__).parents[3] / "shared" / "data"))
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
MASSES = [
    4.19482729888,
    4.29968485891,
    3.65854579331,
    2.38458329373,
    1.70358047732,
    0.399897935153,
    0.649963851823,
]


def test_the_lwr_is_stacked_along_z_with_axes_that_alternate(arm):
    height = [0.12, 0.20, 0.20, 0.20, 0.20, 0.19, 0.078]
    np.testing.assert_allclose(arm.translation, [[0, 0, z] for z in height], rtol=0, atol=1e-8)
    assert torch.equal(arm.rotation, torch.eye(3, dtype=torch.float64).expand(7, 3, 3))
    z, y = [0, 0, 1], [0, 1, 0]
    assert arm.axis.tolist() == [z, [0, -1, 0], z, y, z, [0, -1, 0], z]
    assert not arm.prismatic.any()
    data = (model := pinocchio_model(arm)).createData()
    pin.forwardKinematics(model, data, np.zeros(7))
    np.testing.assert_allclose(data.oMi[7].act(arm.tip.numpy()), [0, 0, 1.188], atol=1e-12)


def test_limits_of_the_lwr(arm):
    position = [2.96706, 2.09440, 2.96706, 2.09440, 2.96706, 2.09440, 2.96706]
    assert arm.position_upper.tolist() == position == (-arm.position_lower).tolist()
    assert arm.velocity_limit.tolist() == [1.91986, 1.91986, 2.26893, 2.26893, 2.26893, 3.14159, 3.14159]
    assert arm.torque_limit.tolist() == [176, 176, 100, 100, 100, 38, 38]


def test_inertias_of_the_lwr_are_those_of_the_table(arm):
    np.testing.assert_allclose(arm.inertial_parameters[:, 0], MASSES, rtol=1e-7)
    table = DATA / "kuka_lwr4" / "inertial_parameters.csv"
    if not table.is_file():
        pytest.skip(f"the table of inertial parameters is not at {table}; set SIDEGAN_DATA")
    figures = np.loadtxt(table, delimiter=",", skiprows=1)[:, 1:]
    np.testing.assert_allclose(arm.inertial_parameters, figures, rtol=0, atol=1e-12)


def test_the_lwr_has_43_base_parameters(arm):
    model, random = pinocchio_model(arm), np.random.default_rng(0)
    data, states = model.createData(), random.uniform(-2, 2, (100, 3, 7))
    rows = np.vstack([pin.computeJointTorqueRegressor(model, data, *state) for state in states])
    singular = np.linalg.svd(rows, compute_uv=False)
    assert (singular > 1e-10 * singular[0]).sum() == 43


def test_capsules_of_the_lwr_are_those_of_the_table_and_pinocchio_sees_the_same(arm):
    capsules, distances = arm.capsules, []
    found = torch.cat([capsules.a, capsules.b, capsules.radius[:, None]], 1)
    np.testing.assert_allclose(found, CAPSULES, rtol=0, atol=1e-14)
    assert capsules.link.tolist() == [-1, 0, 1, 2, 3, 4, 5, 6]
    assert capsules.names == ("base", *(f"link_{i}" for i in range(1, 8)))
    model = pinocchio_model(arm)
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


PLANAR = load_robot("planar2")
MODEL = pinocchio_model(PLANAR)
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
    shoulder = d11 * ddq[0] + d12 * ddq[1] + h * dq[1] * (2 * dq[0] + dq[1]) + fall1
    return np.array([shoulder, d12 * ddq[0] + d22 * ddq[1] - h * dq[0] ** 2 + fall2])


@given(arrays(np.float64, (3, 2), elements=st.floats(-10, 10)))
def test_torque_of_planar2_is_the_textbooks(state):
    torque = pin.rnea(MODEL, MODEL.createData(), *state)
    np.testing.assert_allclose(torque, closed_form(*state), rtol=1e-12, atol=1e-10)  # N·m


def test_torque_limits_of_planar2_are_generous():
    draw = torch.rand(500, 3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * 2 - 1
    most = torch.stack([PLANAR.position_upper, PLANAR.velocity_limit, torch.full((2,), 10.0)])
    torques = [pin.rnea(MODEL, MODEL.createData(), *state) for state in (draw * most).numpy()]
    assert (np.abs(torques) < PLANAR.torque_limit.numpy()).all()
