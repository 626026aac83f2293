"""Pictures of motion: what they show is where Pinocchio has it."""

import numpy as np
import pinocchio
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.image import imread

from sidegan.motion.trajectory import Trajectory
from sidegan.report.canvas import save
from sidegan.report.motion import Bundle, bounds, paths, poses, surfaces, tip_paths
from sidegan.robot.visuals import capsule_surface
from tests.oracle import chain_model

FAMILY, LONG = Trajectory(2, harmonics=3, period=4.0), Trajectory(2, harmonics=5, period=12.0)
SEVEN = Trajectory(7)
POINTS = arrays(float, 3, elements=st.floats(-2, 2, width=16))


def some(family, count):
    """Coefficients [rad/s], (count, J, H, 2)."""
    return 0.3 * np.random.default_rng(count).standard_normal((count, *family.shape))


def test_a_path_is_where_pinocchio_has_the_end_effector(arm):
    coefficients, times = some(SEVEN, 2), SEVEN.times(25.0)
    traces = tip_paths(arm, SEVEN, coefficients)
    assert traces.shape == (2, len(times), 3)
    model = chain_model(arm)
    data = model.createData()
    positions = SEVEN.derivative(coefficients, times, 0)
    for k, step in ((0, 0), (0, 123), (1, 300)):
        pinocchio.forwardKinematics(model, data, positions[k, step])
        np.testing.assert_allclose(traces[k, step], data.oMi[arm.joints].act(arm.tip), atol=1e-12)
    np.testing.assert_allclose(traces[:, 0], traces[:, -1], atol=1e-12)  # home at both ends


def test_poses_stand_where_pinocchio_has_the_links(arm):
    c, model, times, capsules = some(SEVEN, 2), chain_model(arm), SEVEN.times(25.0), arm.capsules
    figure, samples = poses(arm, SEVEN, c, 3), (0, 133, 267)  # of the 401 times
    assert len(figure.axes) == 6 and [axis.get_title("left") for axis in figure.axes[::3]] == ["a", "b"]
    assert [axis.get_title() for axis in figure.axes[:3]] == [f"{times[k]:.3g} s" for k in samples]
    q, data = SEVEN.derivative(c[:1], times[list(samples)], 0)[0], model.createData()
    for positions, triangles in zip(q, surfaces(arm, q)):
        pinocchio.forwardKinematics(model, data, positions)
        expected = []
        for link, *shape in zip(capsules.link, capsules.a, capsules.b, capsules.radius):
            (vertices, faces), place = capsule_surface(*shape), data.oMi[int(link) + 1]
            expected.append((vertices @ place.rotation.T + place.translation)[faces])
        np.testing.assert_allclose(triangles, np.concatenate(expected), atol=1e-12)


@given(POINTS, POINTS, st.floats(0.01, 0.5))
def test_a_capsules_surface_is_at_its_radius_and_faces_outwards(a, b, radius):
    vertices, faces = capsule_surface(a, b, radius)
    along = b - a
    share = np.clip((vertices - a) @ along / max(along @ along, 1e-18), 0, 1)
    away = vertices - (a + share[:, None] * along)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), radius, rtol=1e-6)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * away[faces].mean(1)).sum(1) > -1e-12).all()
    assert len(np.unique(faces)) == len(vertices)


def test_bounds_hold_all_points_and_the_foot_of_the_arm_on_the_desk():
    points = np.array([[0.5, 0.2, 0.3], [0.6, 0.4, 1.0]])
    low, high = bounds([points])
    assert low[2] == 0.0 and (low[:2] < 0).all() and (high > [0.6, 0.4, 1.0]).all()
    assert bounds([points - [0, 0, 2]])[0, 2] < -1.7  # below the desk is drawn, too


def test_bundles_share_one_scale_and_render_reproducibly(planar, tmp_path):
    bundles = [Bundle(f"trajectory {k}", FAMILY, c[None]) for k, c in enumerate(some(FAMILY, 3))]
    bundles += [Bundle("long\n12 s", LONG, some(LONG, 1), "#b2182b")]
    bundles += [Bundle("eigen", FAMILY, some(FAMILY, 3), "#1f77b4")]
    figure = paths(planar, bundles)
    assert [axis.get_title() for axis in figure.axes] == [bundle.title for bundle in bundles]
    assert len({axis.get_xlim() + axis.get_zlim() for axis in figure.axes}) == 1
    first, second = save(figure, tmp_path / "a"), save(paths(planar, bundles), tmp_path / "b")
    assert first.read_bytes() == second.read_bytes() and np.ptp(imread(first)[..., :3]) > 0.5
