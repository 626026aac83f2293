"""Capsules, their distances and nearest points: coal and exact geometry in extended precision as oracles."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

from sidegan.base.arrays import Array
from sidegan.robot import Arm
from sidegan.validity import Constraints
from sidegan.validity.capsules import clearances
from tests.chains import lenient, random_states
from tests.oracle import capsule_geometry, chain_model

from .critical import random_segments, segments_as_capsules


def segment_distance(a1: Array, b1: Array, a2: Array, b2: Array) -> Array:
    """Distance [m], (N,), of segments with end points (3, N)."""
    first = np.arange(a1.shape[1])
    pairs = np.stack([first, first + len(first)], 1)
    chain, shapes = segments_as_capsules([a1, a2], [b1, b2], pairs, pairs[:0])
    return clearances(chain, shapes, np.zeros((1, 2)))[0][0]


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
    a, b, shift, wobble = random_segments(20_000, 1, 2)
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
