"""MoveIt's scenes: both forms of the file, every shape, and what is wrong with a file."""

import numpy as np
import pytest
import torch

from sidegan.validity import Convex, Plane, Sphere
from sidegan.validity.scene import read_scene

NEW = """(noname)+++
* a table with a name
0.5 0 0.2
0 0 0.7071067811865476 0.7071067811865476
2
box
0.4 0.8 0.1
0.1 0 0
0 0 0 1
0 0 0 0
sphere
0.15
0 0 0.3
0 0 0 1
0.5 0.5 0.5 1
1
handle
0 0 0
0 0 0 1
* wedge
0 0 0
0 0 0 1
1
mesh
4 4
0 0 0
1 0 0
0 1 0
0 0 1
0 1 2
0 1 3
0 2 3
1 2 3
0 0 0
0 0 0 1
0 0 0 0
0
.
"""
OLD = """(noname)+++
* rod
1
cylinder
0.1 0.6
0 0.5 0
0 0.7071067811865476 0 0.7071067811865476
0 0 0 0
* hat
1
cone
0.2 0.4
0 0 0.5
0 0 0 1
0 0 0 0
* ground
1
plane
0 0 2 0.1
0 0 0
0 0 0 1
0 0 0 0
.
"""


@pytest.fixture
def read(tmp_path):
    """The regions of a scene's text."""

    def of(text):
        (tmp_path / "file.scene").write_text(text)
        return read_scene(tmp_path / "file.scene")

    return of


def at(region, *point):
    """Signed distance [m] of a point."""
    x = torch.tensor([point], dtype=torch.float64).T
    return float(region.margin(x, x))


def test_objects_with_poses_of_their_own(read):
    box, ball, wedge = read(NEW)
    assert isinstance(box, Convex) and isinstance(wedge, Convex)
    np.testing.assert_allclose(box.points.min(0), [0.1, -0.1, 0.15], atol=1e-9)  # a quarter turn about z
    np.testing.assert_allclose(box.points.max(0), [0.9, 0.3, 0.25], atol=1e-9)
    assert isinstance(ball, Sphere) and ball.radius == 0.15
    assert ball.centre == pytest.approx((0.5, 0.0, 0.5))
    assert at(wedge, 0.1, 0.1, 0.1) == pytest.approx(-0.1) and at(wedge, -0.3, 0.2, 0.2) == pytest.approx(0.3)


def test_objects_without_poses(read):
    rod, hat, ground = read(OLD)
    assert at(rod, 0.5, 0.5, 0) == pytest.approx(0.2, abs=1e-3)  # it lies along x
    assert at(rod, 0, 0.5, 0.3) == pytest.approx(0.2, abs=1e-3)
    assert at(hat, 0, 0, 0.9) == pytest.approx(0.2, abs=0.01) and at(hat, 0, 0, 0.5) < -0.05
    assert at(hat, 0.15, 0, 0.65) > 0.05  # where a cylinder would be
    assert isinstance(ground, Plane) and ground.offset == pytest.approx(-0.05) and ground.unit == [0, 0, 1]


def test_an_empty_scene_is_one(read):
    assert read("(noname)+++\n.\n") == []
