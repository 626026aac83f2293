"""The built-in LWR IV against the figures it was written from."""

import os
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import torch

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


@pytest.fixture(scope="module")
def arm():
    return load_robot("kuka_lwr4")


def test_all_frames_are_parallel_and_stacked_along_z(arm):
    height = torch.zeros(7, 3, dtype=torch.float64)
    height[:, 2] = torch.tensor([0.12, 0.20, 0.20, 0.20, 0.20, 0.19, 0.078])
    torch.testing.assert_close(arm.translation, height, rtol=0, atol=1e-8)
    torch.testing.assert_close(
        arm.rotation, torch.eye(3, dtype=torch.float64).expand(7, 3, 3), rtol=0, atol=0
    )


def test_axes_alternate_between_z_and_y(arm):
    z, y = [0, 0, 1], [0, 1, 0]
    assert arm.axis.tolist() == [z, [0, -1, 0], z, y, z, [0, -1, 0], z]
    assert not arm.prismatic.any()


def test_limits(arm):
    position = [2.96706, 2.09440, 2.96706, 2.09440, 2.96706, 2.09440, 2.96706]
    assert arm.position_upper.tolist() == position
    assert arm.position_lower.tolist() == [-p for p in position]
    assert arm.velocity_limit.tolist() == [1.91986, 1.91986, 2.26893, 2.26893, 2.26893, 3.14159, 3.14159]
    assert arm.torque_limit.tolist() == [176, 176, 100, 100, 100, 38, 38]


def test_inertial_parameters_are_those_of_the_table(arm):
    table = DATA / "kuka_lwr4" / "inertial_parameters.csv"
    if not table.is_file():
        pytest.skip(f"the table of inertial parameters is not at {table}; set SIDEGAN_DATA")
    figures = np.loadtxt(table, delimiter=",", skiprows=1)[:, 1:]
    np.testing.assert_allclose(arm.inertial_parameters, figures, rtol=0, atol=1e-12)


def test_masses(arm):
    masses = [4.19482729888, 4.29968485891, 3.65854579331, 2.38458329373, 1.70358047732, 0.399897935153]
    masses.append(0.649963851823)
    torch.testing.assert_close(arm.inertial_parameters[:, 0], torch.tensor(masses, dtype=torch.float64))
    assert arm.inertial_parameters[:, 0].sum().item() == pytest.approx(17.291, abs=1e-4)  # kg


def test_every_link_could_be_made_of_matter(arm):
    for parameters in arm.inertial_parameters.numpy():
        pseudo_inertia = pin.PseudoInertia.FromDynamicParameters(parameters).toMatrix()
        assert np.linalg.eigvalsh(pseudo_inertia).min() > 0.0


def test_there_are_43_base_parameters(arm):
    model = pinocchio_model(arm)
    random = np.random.default_rng(0)
    rows = [
        pin.computeJointTorqueRegressor(model, model.createData(), *random.uniform(-2, 2, (3, 7)))
        for _ in range(100)
    ]
    singular = np.linalg.svd(np.vstack(rows), compute_uv=False)
    assert (singular > 1e-10 * singular[0]).sum() == 43


def test_capsules(arm):
    capsules = arm.capsules
    found = torch.cat([capsules.a, capsules.b, capsules.radius[:, None]], 1)
    torch.testing.assert_close(found, torch.tensor(CAPSULES, dtype=torch.float64), rtol=0, atol=1e-14)
    assert capsules.link.tolist() == [-1, 0, 1, 2, 3, 4, 5, 6]
    assert capsules.names == ("base", *(f"link_{i}" for i in range(1, 8)))


def test_pinocchio_sees_the_same_capsules(arm):
    model = pinocchio_model(arm)
    theirs = pin.buildGeomFromUrdf(model, str(arm.urdf), pin.GeometryType.COLLISION)
    ours = capsule_geometry(arm)
    theirs.addAllCollisionPairs()
    ours.addAllCollisionPairs()
    random = np.random.default_rng(1)
    for q in random.uniform(-2, 2, (20, 7)):
        distances = []
        for geometry in (theirs, ours):
            data = geometry.createData()
            pin.computeDistances(model, model.createData(), geometry, data, q)
            distances.append([result.min_distance for result in data.distanceResults])
        # m; a pair that touches is known less exactly: its distance is a depth
        apart = np.array(distances[0]) > 0
        np.testing.assert_allclose(np.array(distances[1])[apart], np.array(distances[0])[apart], atol=1e-6)


def test_is_upright_at_zero(arm):
    model = pinocchio_model(arm)
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(7))
    np.testing.assert_allclose(data.oMi[7].act(arm.tip.numpy()), [0, 0, 1.188], atol=1e-12)
