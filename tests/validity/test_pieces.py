"""What is inside of capsules: distances against coal, and the proof by them."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from sidegan.kernels import gjk as kernel
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check

from .critical import filled, moderate


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
