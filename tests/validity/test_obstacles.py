"""Convex obstacles against coal's distances: never more, and short by little."""

import math

import coal
import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull

from sidegan.errors import ConfigError
from sidegan.validity import Box, Convex, Sphere
from sidegan.validity.obstacles import directions

from .test_regions import random_segments

RANDOM = np.random.default_rng(0)
TURN = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0]
BODIES = {
    "ball": Sphere((0.1, -0.2, 0.3), 0.3),
    "box": Convex.box((0.4, 0.6, 0.2)).placed(TURN, np.array([0.1, 0.2, -0.1])),
    "cylinder": Convex.between((-0.2, 0.1, 0.0), (0.3, -0.2, 0.4), 0.2),
    "cone": Convex.cylinder(0.3, 0.5, 0.0),
    "wedge": Convex.around(
        np.array([[0, 0, 0], [1, 0, 0], [0, 0.05, 0], [1, 0.05, 0], [0, 0, 0.5], [1, 0, 0.5]])
    ),
    "cloud": Convex.around(0.3 * RANDOM.normal(size=(40, 3))),
}


def coals(body):
    """The body as coal has it, without our planes."""
    if isinstance(body, Sphere):
        return coal.Sphere(body.radius), coal.Transform3s(np.eye(3), np.array(body.centre))
    hull, mesh = ConvexHull(body.points), coal.BVHModelOBBRSS()
    mesh.beginModel(len(hull.simplices), len(body.points))
    mesh.addVertices(body.points)
    mesh.addTriangles(hull.simplices)
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex, coal.Transform3s.Identity()


@pytest.mark.parametrize("name", BODIES)
def test_the_margin_is_never_more_than_coals_distance_and_short_by_little(name):
    body, (shape, place) = BODIES[name], coals(BODIES[name])
    a, b = random_segments(300)
    margin, apart = body.margin(a, b).numpy(), 0
    for k in range(300):
        middle, along = (a[:, k] + b[:, k]).numpy() / 2, (b[:, k] - a[:, k]).numpy()
        length = np.linalg.norm(along)
        turn = _onto(along / length)
        result = coal.DistanceResult()
        rod = coal.Capsule(1e-6, length)
        distance = coal.distance(
            rod, coal.Transform3s(turn, middle), shape, place, coal.DistanceRequest(), result
        )
        assert margin[k] <= max(distance, 0) + 1e-5  # coal's depths are those of the whole segment
        if distance > 1e-3:
            apart += 1
            assert margin[k] >= 0.9 * distance - 1e-5
        else:
            assert margin[k] <= 1e-3
    assert apart > 60


def _onto(z):
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], 1)


def test_a_box_at_no_angle_is_a_box_but_for_edges_and_corners():
    plain, body = Box((-0.2, -0.3, -0.1), (0.2, 0.3, 0.1)), BODIES["box"]
    straight = Convex.box((0.4, 0.6, 0.2))
    a, b = random_segments(300)
    ours, theirs = straight.margin(a, b), plain.margin(a, b)
    inside = theirs < 0
    torch.testing.assert_close(ours[inside], theirs[inside], atol=1e-8, rtol=0)
    assert (ours <= theirs + 1e-9).all() and inside.sum() > 20 and isinstance(body, Convex)


def test_directions_are_even_all_over():
    random = np.random.default_rng(1).normal(size=(2000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    assert (random @ directions().T).max(1).min() > math.cos(math.radians(21))


@pytest.mark.parametrize(
    "make",
    [
        lambda: Sphere((0, 0, 0), 0.0),
        lambda: Sphere((0, 0), 1.0),
        lambda: Sphere((0, math.nan, 0), 1.0),
        lambda: Convex.between((0, 0, 0), (0, 0, 0), 1.0),
        lambda: Convex.between((0, 0, 0), (0, 0, 1), -1.0),
        lambda: Convex.between((0, 0, 0), (0, 1), 1.0),
        lambda: Convex.around(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])),
        lambda: Convex.around(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, math.inf]])),
    ],
)
def test_impossible_obstacles_are_refused(make):
    with pytest.raises(ConfigError, match=r"a sphere needs|a cylinder needs|an obstacle needs"):
        make()
