import numpy as np
import pinocchio
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.report.pose import arm_mesh, bounds, capsule_mesh, film, tip_traces
from sidegan.robot import pinocchio_model

POINTS = arrays(float, 3, elements=st.floats(-2, 2, width=16))


@pytest.fixture
def coefficients():
    return 0.3 * torch.randn(2, 7, 6, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


def test_a_trace_is_where_pinocchio_has_the_end_effector(arm, coefficients):
    family = Trajectory(7)
    traces = tip_traces(arm, family, coefficients)
    times = family.times(25.0)
    assert traces.shape == (2, len(times), 3)
    model = pinocchio_model(arm)
    data = model.createData()
    positions = family.derivative(coefficients, times, 0)
    for k, step in ((0, 0), (0, 123), (1, 300)):
        pinocchio.forwardKinematics(model, data, positions[k, step].numpy())
        np.testing.assert_allclose(traces[k, step], data.oMi[arm.joints].act(arm.tip.numpy()), atol=1e-12)
    np.testing.assert_allclose(traces[:, 0], traces[:, -1], atol=1e-12)  # home at both ends


@given(POINTS, POINTS, st.floats(0.01, 0.5))
def test_a_capsules_surface_is_at_its_radius_and_faces_outwards(a, b, radius):
    mesh = capsule_mesh(a, b, radius)
    along = b - a
    share = np.clip((mesh.vertices - a) @ along / max(along @ along, 1e-18), 0, 1)
    away = mesh.vertices - (a + share[:, None] * along)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), radius, rtol=1e-6)
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    outwards = (normals * away[mesh.faces].mean(1)).sum(1)
    assert (outwards > 0).all()
    assert mesh.faces.min() == 0 and mesh.faces.max() == len(mesh.vertices) - 1


def test_an_arms_mesh_holds_all_its_capsules(arm):
    mesh = arm_mesh(arm, torch.zeros(7, dtype=torch.float64))
    assert len(mesh.vertices) >= 8 * len(arm.capsules.radius)
    assert mesh.faces.max() == len(mesh.vertices) - 1
    assert mesh.vertices[:, 2].max() > 1.0  # upright at home


def test_a_film_leaves_out_the_ends(arm, coefficients):
    scene = film(arm, Trajectory(7), coefficients[:1], 4)
    np.testing.assert_allclose(scene.times, [2, 6, 10, 14])
    assert len(scene.meshes) == 4
    with pytest.raises(ShapeError, match="one trajectory, got 2"):
        film(arm, Trajectory(7), coefficients, 4)
    with pytest.raises(ShapeError, match="at least one sample"):
        film(arm, Trajectory(7), coefficients[:1], 0)


def test_bounds_hold_all_points_and_the_foot_of_the_arm_on_the_desk():
    points = np.array([[0.5, 0.2, 0.3], [0.6, 0.4, 1.0]])
    low, high = bounds([points], 0.0)
    assert low[2] == 0.0 and (low[:2] < 0).all() and (high > [0.6, 0.4, 1.0]).all()
    low, high = bounds([points], None)
    assert (low > 0).all()
    assert bounds([points - [0, 0, 2]], 0.0)[0, 2] < -1.7  # below the desk is drawn, too
