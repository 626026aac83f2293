"""Surfaces of solids: closed, looking outwards, and around as much as the solid holds."""

import math
from collections import Counter

import numpy as np
import pytest

from sidegan.robot.solids import box, capsule, cylinder

BALL = 4 / 3 * math.pi * 0.1**3
SOLIDS = {
    "box": (box((0.2, 0.3, 0.4)), 0.024, 1e-12),
    "cylinder": (cylinder(0.1, 0.5), math.pi * 0.1**2 * 0.5, 0.01),  # its circles have corners
    "capsule": (capsule(0.1, 0.4), math.pi * 0.1**2 * 0.4 + BALL, 0.02),
    "ball": (capsule(0.1, 0.0), BALL, 0.02),
}


@pytest.mark.parametrize(("surface", "volume", "tolerance"), SOLIDS.values(), ids=SOLIDS)
def test_a_surface_is_closed_and_holds_the_volume(surface, volume, tolerance):
    """Each edge belongs to two triangles, which go along it in opposite directions."""
    vertices, faces = surface
    corners = vertices[faces]
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(volume, rel=tolerance)
    _, place = np.unique(vertices.round(9), axis=0, return_inverse=True)  # poles are many vertices
    triangles = [face for face in place[faces].tolist() if len(set(face)) == 3]
    edges = Counter((face[k - 1], face[k]) for face in triangles for k in range(3))
    assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
