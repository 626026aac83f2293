"""Mesh files of obstacles."""

import numpy as np
import pytest
import trimesh

from sidegan.errors import ConfigError
from sidegan.robot.meshes import read_mesh


def test_corners_and_volume_come_back(tmp_path):
    trimesh.creation.box((0.2, 0.3, 0.5)).export(tmp_path / "box.stl")
    corners, volume = read_mesh(tmp_path / "box.stl")
    np.testing.assert_allclose(np.abs(corners).max(0), [0.1, 0.15, 0.25], atol=1e-7)
    assert volume == pytest.approx(0.03, rel=1e-6)


def test_the_smallest_body_has_four_faces(tmp_path):
    corners, faces = np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    for count in (4, 3):
        trimesh.Trimesh(corners, faces[:count], process=False).export(tmp_path / f"{count}.stl")
    assert read_mesh(tmp_path / "4.stl")[1] == pytest.approx(1 / 6, rel=1e-6)
    with pytest.raises(ConfigError, match=r"3\.stl cannot be read: it has no closed surface"):
        read_mesh(tmp_path / "3.stl")
