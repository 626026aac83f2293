"""Keep-out regions: closed forms and brute force; obstacles against coal: never more, and short by little."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from sidegan.validity import Box, Convex, Plane, Sphere
from sidegan.validity.capsules import clearances

from .critical import BLOCK, random_segments, segments_as_capsules
from .test_pieces import convex

BALL, ROD = Sphere((0.1, -0.2, 0.3), 0.3), Convex.between((-0.2, 0.1, 0.0), (0.3, -0.2, 0.4), 0.2)
BOX = Box((-0.3, -0.2, 0.1), (0.5, 0.4, 0.3))


def margins(region, a, b):
    """Signed distance [m], (N,), of segments with end points (3, N) to a region."""
    guarded = np.stack([np.zeros(a.shape[1]).astype(int), np.arange(a.shape[1])], 1)
    chain, shapes = segments_as_capsules([a], [b], guarded[:0], guarded, [region])
    return clearances(chain, shapes, np.zeros((1, 2)).astype(float))[1][0]


def test_plane_margin_is_that_of_the_lower_end() -> None:
    plane = Plane((0.0, 0.6, 0.8), 2.0)
    a, b = (np.array([x]).T for x in ([1, 5, 0], [1, 0, 5]))
    assert margins(plane, a, b).tolist() == pytest.approx([0.6 * 5 - 2])
    a, b = random_segments(100)
    unit = np.array(plane.unit, dtype=float)
    along = np.stack([unit @ x - 2.0 for x in (a, (a + b) / 2, b)])
    np.testing.assert_allclose(margins(plane, a, b), along.min(0), atol=1e-9)


def test_box_margin_is_the_least_along_the_segment() -> None:
    a, b = random_segments(300)
    shares = np.linspace(0, 1, 201)[:, None, None]
    points = (a + shares * (b - a)).transpose(0, 2, 1)
    lower, upper = np.array([BOX.lower, BOX.upper])
    within = np.minimum(points - lower, upper - points).min(-1)  # face by face
    beside = np.linalg.norm(points - np.clip(points, lower, upper), axis=-1)
    brute = np.where(within > 0, -within, beside).min(0)
    margin = margins(BOX, a, b)
    assert (brute - np.linalg.norm(a - b, axis=0) / 400 <= margin).all() and (margin <= brute + 1e-8).all()
    assert (margin < 0).sum() > 30 and (margin > 0).sum() > 100


RANDOM = np.random.default_rng(0)
TURN = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0]
BODIES = {
    "ball": BALL,
    "box": Convex.around(BLOCK.points @ TURN.T + np.array([0.1, 0.2, -0.1])),
    "cylinder": ROD,
    "wedge": Convex.around(np.array([[x, *yz] for x in (0, 1) for yz in ((0, 0), (0.05, 0), (0, 0.5))])),
    "cloud": Convex.around(0.3 * RANDOM.normal(size=(40, 3))),
}


@pytest.mark.parametrize("name", BODIES)
def test_the_margin_is_at_most_coals_distance_and_not_much_less(name):
    body, place = BODIES[name], coal.Transform3s.Identity()
    if isinstance(body, Sphere):
        shape, place = coal.Sphere(body.radius), coal.Transform3s(np.eye(3), np.array(body.centre))
    else:  # without our planes
        shape = convex(body.points[ConvexHull(body.points).vertices])
    a, b = random_segments(300)
    margin, apart = margins(body, a, b), 0
    for k in range(300):
        middle, along = (a[:, k] + b[:, k]) / 2, (b[:, k] - a[:, k])
        length = np.linalg.norm(along)
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0, 1]), along)
        rod, at = coal.Capsule(1e-6, length), coal.Transform3s(turn.matrix(), middle)
        distance = coal.distance(rod, at, shape, place, coal.DistanceRequest(), coal.DistanceResult())
        assert margin[k] <= max(distance, 0) + 1e-5  # coal's depths are those of the whole segment
        if distance > 1e-3:
            apart += 1
            assert margin[k] >= 0.9 * distance - 1e-5
        else:
            assert margin[k] <= 1e-3
    assert apart > 60


def test_an_unrotated_convex_box_agrees_with_a_box():
    plain, straight = Box((-0.2, -0.3, -0.1), (0.2, 0.3, 0.1)), BLOCK
    ours, theirs = (margins(body, *random_segments(300)) for body in (straight, plain))
    inside = theirs < 0
    np.testing.assert_allclose(ours[inside], theirs[inside], atol=1e-8, rtol=0)
    assert (ours <= theirs + 1e-9).all() and inside.sum() > 20
