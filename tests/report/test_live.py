"""What the live viewer shows is what the page holds."""

import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.motion.trajectory import Trajectory
from sidegan.report import live
from sidegan.report.viewer import view_of, write_view
from sidegan.robot import chain_model
from sidegan.validity import Constraints, Sphere

FAMILY = Trajectory(7, 3, 8.0)


@pytest.fixture(scope="module")
def shown(arm, tmp_path_factory):
    c = 0.3 * torch.randn(2, 7, 3, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    path = tmp_path_factory.mktemp("live") / live.PAGE
    write_view(view_of(Constraints(arm, [Sphere((1.0, 0, 0.5), 0.1)]), FAMILY, c), path)
    return live.Show(path), c, path


def test_joints_are_where_pinocchio_has_them(arm, shown):
    show, c, _ = shown
    q = show.positions(1, 0.37)
    expected = FAMILY.derivative(c, torch.tensor([0.37 * 8], dtype=torch.float64), 0)[1, 0]
    np.testing.assert_allclose(q, expected, atol=2e-3)
    model = chain_model(arm)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    turns, places = show.frames(q)
    for k in range(7):
        np.testing.assert_allclose(turns[k], data.oMi[k + 1].rotation, atol=1e-12)
        np.testing.assert_allclose(places[k], data.oMi[k + 1].translation, atol=1e-12)


def test_quaternions_are_the_rotations(shown):
    for _ in range(50):
        turn = pin.SE3.Random().rotation
        w, x, y, z = live.quaternion(turn)
        np.testing.assert_allclose(pin.Quaternion(w, x, y, z).matrix(), turn, atol=1e-12)


def test_surfaces_are_the_obstacles(shown):
    vertices, faces = shown[0].surface("obstacles", 0)
    np.testing.assert_allclose(np.linalg.norm(vertices - [1, 0, 0.5], axis=1), 0.1, atol=1e-5)
    assert faces.max() < len(vertices)


def test_what_is_no_page_is_refused(tmp_path, capsys):
    (tmp_path / live.PAGE).write_text("<html></html>")
    assert live.main([str(tmp_path)]) == 1
    assert live.main([str(tmp_path / "lost")]) == 1
    assert "is no page that excite has written" in capsys.readouterr().err
