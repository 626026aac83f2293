"""Distances of capsules, hulls and regions: closed forms, extended precision and coal as oracles."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.kernels import gjk as kernel
from sidegan.motion.arrays import chain_of, kernel_shapes
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, load_robot
from sidegan.validity import Box, Constraints, Convex, Obstacle, Plane, Sphere, check
from sidegan.validity.capsules import capsule_clearances
from sidegan.validity.regions import tables
from tests.chains import exact_capsules, lenient, random_states
from tests.motion.conftest import normal
from tests.oracle import capsule_geometry, chain_model
from tests.refusals import refused

from .critical import BLOCK, filled, moderate


def clearances(a: Array, b: Array, pairs: Array, guarded: Array, *regions: Obstacle) -> list[Array]:
    """Distances [m] of segments with end points (3, N): of pairs, (P,), and from regions, (K,)."""
    none = np.zeros(a.shape[1])
    capsules = exact_capsules(none.astype(int) - 1, a.T, b.T, none, ("",) * len(none))  # on the base
    shapes = kernel_shapes(capsules, pairs, guarded, tables(regions))
    found = capsule_clearances(chain_of(load_robot("planar2")), shapes, np.zeros((1, 2)))
    return [distance[0] for distance in found]


def segment_distance(a1: Array, b1: Array, a2: Array, b2: Array) -> Array:
    """Distance [m], (N,), of segments with end points (3, N)."""
    first = np.arange(a1.shape[1])
    pairs = np.stack([first, first + len(first)], 1)
    return clearances(np.hstack([a1, a2]), np.hstack([b1, b2]), pairs, pairs[:0])[0]


def point_to_segment(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    along = b - a
    length = (along * along).sum(0)
    s = np.clip(((p - a) * along).sum(0) / np.where(length > 0, length, 1), 0, 1)
    return np.sqrt(((a + s * along - p) ** 2).sum(0))


def exact_distance(*ends: Array) -> np.ndarray:
    """Distance in extended precision: of an end from a segment or along the common normal, the least."""
    a1, b1, a2, b2 = (x.astype(np.longdouble) for x in ends)
    at_ends = [(a1, a2, b2), (b1, a2, b2), (a2, a1, b1), (b2, a1, b1)]
    distance = np.minimum.reduce([point_to_segment(*case) for case in at_ends])
    u, v, r = b1 - a1, b2 - a2, a2 - a1
    normal = np.cross(u, v, axis=0)
    square = (normal * normal).sum(0)
    safe = np.where(square > 0, square, 1)
    s, t = ((np.cross(r, x, axis=0) * normal).sum(0) / safe for x in (v, u))
    inside = (square > 0) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    return np.where(inside, np.abs((r * normal).sum(0)) / np.sqrt(safe), distance).astype(float)


@pytest.mark.parametrize("angle", [1e-1, 1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-12, 0.0])
def test_nearly_parallel_segments(angle: float) -> None:
    """Segments 0.1 m apart, and segments that cross."""
    a, b, shift, wobble = 0.6 * normal(4, 3, 20_000)
    for length in (1e-3, 1.0):
        along = length * b
        start = a + 0.5 * length * wobble + 0.1 * shift / np.linalg.norm(shift, axis=0)
        segments = a, a + along, start, start - 1.3 * along + angle * length * wobble
        np.testing.assert_allclose(segment_distance(*segments), exact_distance(*segments), atol=2e-7 * length)
    other = b + angle * wobble
    assert segment_distance(a - b, a + b, a - other, a + other).max() < 3e-7


def test_segments_on_a_lattice() -> None:
    """Parallel, collinear, overlapping, touching and degenerate ones by the hundred."""
    segments = np.random.default_rng(0).choice([-1.0, -0.5, 0.0, 0.5, 1.0], (4, 3, 20_000))
    np.testing.assert_allclose(segment_distance(*segments), exact_distance(*segments), atol=2e-12)
    a1, b1, a2, b2 = segments
    turned = segment_distance(a2, b2, b1, a1)
    np.testing.assert_allclose(turned, segment_distance(*segments), atol=1e-12, rtol=0)


def coal_distances(constraints: Constraints, q: Array) -> np.ndarray:
    """Distances [m] of the capsules by coal, (N, P); below zero where they overlap."""
    model, geometry = chain_model(constraints.arm), capsule_geometry(constraints.arm)
    for pair in constraints.pairs.tolist():
        geometry.addCollisionPair(pin.CollisionPair(*pair))
    data, shapes = model.createData(), geometry.createData()
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    shapes.distanceRequests[:] = [request] * len(constraints.pairs)
    found = np.empty((len(q), len(constraints.pairs)))
    for row, position in zip(found, q):
        pin.computeDistances(model, data, geometry, shapes, position)
        row[:] = [result.min_distance for result in shapes.distanceResults]
    return found


@pytest.mark.parametrize("thicker", [0.0, 0.05, 0.15])
def test_capsule_distances_agree_with_coal(arm: Arm, thicker: float) -> None:
    """The arm's own capsules hardly ever meet at random; thicker ones do."""
    arm = lenient(replace(arm, capsules=replace(arm.capsules, radius=arm.capsules.radius + thicker)))
    constraints = Constraints(arm)
    q = random_states(arm, 1_000, seed=7)[0]
    ours = constraints.at_rest(q)["collision"]
    theirs = coal_distances(constraints, q)
    apart, deep = theirs > 1e-6, theirs < -1e-6
    assert apart.sum() > 1000 and (thicker < 0.1 or deep.sum() > 1000)
    np.testing.assert_allclose(ours[apart], theirs[apart], atol=1e-9)
    assert (ours[deep] < 0).all()
    distance, which = constraints.nearest(q)
    np.testing.assert_allclose(distance, ours.min(1), atol=0)
    assert (which == ours.argmin(1)).all()


@pytest.mark.parametrize("joints", [6, 8])
def test_positions_of_another_arm_are_refused(arm: Arm, joints: int) -> None:
    constraints, q = Constraints(arm), np.zeros((3, joints))
    for measure in (lambda: constraints.nearest(q), lambda: constraints.distances_at(q[0])):
        with refused(ShapeError, f"{joints})", "(N, 7)"):
            measure()


def hull(random: np.random.Generator) -> np.ndarray:
    """Corners of a random convex body [m], (V, 3), flat or long or neither."""
    points = random.normal(size=(random.integers(4, 60), 3)) * 10.0 ** random.uniform(-2.5, -0.5, 3)
    return points[ConvexHull(points).vertices]


def convex(points: np.ndarray) -> coal.ConvexBase:
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in points:
        corners.append(point)
    for triangle in ConvexHull(points).simplices:
        triangles.append(coal.Triangle(*map(int, triangle)))
    return coal.Convex(corners, triangles)


@settings(max_examples=50)
@given(st.integers(0, 10**6))
def test_hull_distances_agree_with_coal(seed: int) -> None:
    random = np.random.default_rng(seed)
    one, other = hull(random), hull(random)
    first, second, still = convex(one), convex(other), coal.Transform3s()
    zeros, starts = np.zeros(2), np.array([0, len(one), len(one) + len(other)])
    hulls = kernel.Hulls(np.concatenate([one, other]), starts, zeros, zeros, np.array([True]))
    for _ in range(20):
        turn, place = pin.exp3(random.normal(size=3) * 2), 0.3 * random.normal(size=3)
        there, own = coal.Transform3s(turn, place), (coal.DistanceRequest(), coal.DistanceResult())
        expected = coal.distance(first, still, second, there, *own)
        matrix, room = tuple(map(tuple, turn)), np.zeros((6, 4))
        found = kernel.apart(hulls, (0, 1), matrix, tuple(place), tuple(-place), np.inf, room)
        if expected < -1e-6:
            assert np.isneginf(found)
        elif expected > 1e-6:
            assert found == pytest.approx(expected, rel=0, abs=2e-6)  # coal's own is 1e-6
            enough = kernel.apart(hulls, (0, 1), matrix, tuple(place), tuple(-place), found / 2, room)
            assert found / 2 - 1e-12 <= enough <= found + 2e-8


def test_hulls_accept_trajectories_that_capsules_refuse(arm: Arm) -> None:
    full = filled(arm, 1)
    trajectory = Trajectory(7)
    c = moderate(arm, trajectory, 300, 3)
    with_capsules = check(Constraints(arm), trajectory, c).valid
    inside = check(Constraints(full), trajectory, c).valid
    assert (inside >= with_capsules).all() and inside.sum() > with_capsules.sum()


def margins(region, a, b):
    """Signed distance [m], (N,), of segments with end points (3, N) to a region."""
    segments = np.arange(a.shape[1])
    guarded = np.stack([0 * segments, segments], 1)
    return clearances(a, b, guarded[:0], guarded, region)[1]


def test_plane_margin_is_that_of_the_lower_end() -> None:
    a, b = 0.6 * normal(2, 3, 100)
    along = np.stack([0.6 * y + 0.8 * z - 2.0 for _, y, z in (a, (a + b) / 2, b)])
    np.testing.assert_allclose(margins(Plane((0.0, 0.6, 0.8), 2.0), a, b), along.min(0), atol=1e-9)


def test_box_margin_is_the_least_along_the_segment() -> None:
    a, b = 0.6 * normal(2, 3, 300)
    shares = np.linspace(0, 1, 201)[:, None, None]
    points = (a + shares * (b - a)).transpose(0, 2, 1)
    box = Box((-0.3, -0.2, 0.1), (0.5, 0.4, 0.3))
    lower, upper = np.array([box.lower, box.upper])
    within = np.minimum(points - lower, upper - points).min(-1)  # face by face
    beside = np.linalg.norm(points - np.clip(points, lower, upper), axis=-1)
    brute = np.where(within > 0, -within, beside).min(0)
    margin = margins(box, a, b)
    assert (brute - np.linalg.norm(a - b, axis=0) / 400 <= margin).all() and (margin <= brute + 1e-8).all()
    assert (margin < 0).sum() > 30 and (margin > 0).sum() > 100


RANDOM = np.random.default_rng(0)
TURN = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0]
BODIES = {
    "ball": Sphere((0.1, -0.2, 0.3), 0.3),
    "box": Convex.around(BLOCK.points @ TURN.T + np.array([0.1, 0.2, -0.1])),
    "cylinder": Convex.between((-0.2, 0.1, 0.0), (0.3, -0.2, 0.4), 0.2),
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
    a, b = 0.6 * normal(2, 3, 300)
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
