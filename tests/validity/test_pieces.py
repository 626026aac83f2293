"""What is inside of capsules: distances against coal, the two ways to find them, and the proof by them."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.robot.arm import Pieces
from sidegan.validity import Constraints, check
from sidegan.validity.bounds import Slack, cell_motion, jerk_bound
from sidegan.validity.hulls import apart
from sidegan.validity.search import Search
from tests.chains import constrained, random_chain, random_states

from .test_fused import assert_same, moderate

seeds = st.integers(0, 10**6)


def hull(random: np.random.Generator) -> np.ndarray:
    """Corners of a random convex body [m], (V, 3), flat or long or neither."""
    points = random.normal(size=(random.integers(4, 60), 3)) * 10.0 ** random.uniform(-2.5, -0.5, 3)
    return points[ConvexHull(points).vertices]


def convex(points: np.ndarray) -> coal.ConvexBase:
    """The same for coal."""
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in points:
        corners.append(point)
    for triangle in ConvexHull(points).simplices:
        triangles.append(coal.Triangle(*map(int, triangle)))
    return coal.Convex(corners, triangles)


def by_coal(one: np.ndarray, other: np.ndarray, turns: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Signed distances [m], (N,), of a hull from another one that is placed."""
    first, second, still = convex(one), convex(other), coal.Transform3s()
    return np.array([
        coal.distance(
            first, still, second, coal.Transform3s(turn, place), coal.DistanceRequest(), coal.DistanceResult()
        )
        for turn, place in zip(turns, places)
    ])  # fmt: skip


def placements(random: np.random.Generator, count: int, far: float) -> tuple[np.ndarray, np.ndarray]:
    turns = np.array([pin.exp3(random.normal(size=3) * 2) for _ in range(count)])
    return turns, far * random.normal(size=(count, 3))


@given(seeds)
def test_distance_of_hulls_is_that_of_coal(seed: int) -> None:
    random = np.random.default_rng(seed)
    one, other = hull(random), hull(random)
    turns, places = placements(random, 20, 0.3)
    expected = by_coal(one, other, turns, places)
    found = apart((one, np.tile(np.eye(3), (20, 1, 1)), np.zeros((20, 3))), (other, turns, places))
    touching = expected < -1e-6
    assert np.isneginf(found[touching]).all()
    clear = expected > 1e-6
    np.testing.assert_allclose(
        found[clear], expected[clear], rtol=0, atol=2e-6
    )  # coal's own tolerance is 1e-6


@given(seeds)
def test_compiled_distance_is_the_plain_one(seed: int) -> None:
    pytest.importorskip("numba")
    from sidegan.motion.compiled import hulls as kernel

    random = np.random.default_rng(seed)
    one, other = hull(random)[: random.integers(1, 60)], hull(random)
    turns, places = placements(random, 10, 0.3)
    expected = apart((one, np.tile(np.eye(3), (10, 1, 1)), np.zeros((10, 3))), (other, turns, places))
    zeros, starts = np.zeros(2), np.array([0, len(one), len(one) + len(other)])
    hulls = kernel.Hulls(np.concatenate([one, other]), starts, zeros, zeros, np.array([True]))
    for turn, place, distance in zip(turns, places, expected):
        matrix, room = tuple(map(tuple, turn)), np.zeros((5, 4))
        found = kernel.apart(hulls, (0, 1), matrix, tuple(place), tuple(-place), np.inf, room)
        assert np.isfinite(found) == np.isfinite(distance)
        if np.isfinite(found):
            assert found == pytest.approx(distance, abs=2e-8)
            enough = kernel.apart(hulls, (0, 1), matrix, tuple(place), tuple(-place), distance / 2, room)
            assert distance / 2 - 1e-12 <= enough <= distance + 2e-8


def filled(arm: Arm, seed: int) -> Arm:
    """The same arm, with random hulls inside of its capsules, and a few that are the capsules themselves."""
    random = np.random.default_rng(seed)
    capsules = arm.capsules
    corners, exact = [], random.random(len(capsules.radius)) < 0.2
    for k, (a, b, radius) in enumerate(zip(capsules.a.numpy(), capsules.b.numpy(), capsules.radius.tolist())):
        beside = random.normal(size=(20, 3))
        beside *= radius * random.uniform(0.2, 1.0, (20, 1)) / np.linalg.norm(beside, axis=1, keepdims=True)
        corners.append(np.stack([a, b]) if exact[k] else a + random.random((20, 1)) * (b - a) + beside)
    none = torch.zeros(len(corners), dtype=torch.bool)
    pieces = Pieces(
        corners=torch.from_numpy(np.concatenate(corners)),
        start=torch.tensor([0, *np.cumsum([*map(len, corners)])]),
        radius=torch.where(torch.from_numpy(exact), capsules.radius, 0.0),
        exact=torch.from_numpy(exact),
        fitted=none,
        core=0.8 * capsules.radius,
    )
    return replace(arm, capsules=replace(capsules, pieces=pieces))


@given(seeds)
def test_pieces_are_never_nearer_than_their_capsules(seed: int) -> None:
    constraints = constrained(filled(random_chain(4, seed % 50)[0], seed), ())
    q, dq, ddq = random_states(constraints.arm, 200, seed)
    of_capsules = constraints.capsule_margins(q, dq, ddq)
    margins = constraints.margins(q, dq, ddq)
    assert margins.keys() == of_capsules.keys()
    if "collision" in margins:
        assert (margins["collision"] >= of_capsules["collision"]).all()
        still = ~constraints.pieces.finer
        assert torch.equal(margins["collision"][:, still], of_capsules["collision"][:, still])


@pytest.mark.parametrize("half", [0.05, 0.01, 0.0005])
@pytest.mark.parametrize("seed", range(4))
def test_no_distance_changes_by_more_than_its_bound_here(seed: int, half: float) -> None:
    arm = filled(random_chain(5, seed)[0], seed)
    constraints = constrained(arm, ())
    trajectory = Trajectory(5, 3, 3.0)
    c = 0.5 * moderate(arm, trajectory, 6, seed)
    slack, jerk = Slack(constraints), jerk_bound(trajectory, c, 30)
    asked = torch.cartesian_prod(torch.arange(6), torch.nonzero(constraints.pieces.finer)[:, 0])
    for centre in torch.linspace(half, 3.0 - half, 5, dtype=torch.float64).tolist():
        times = torch.linspace(centre - half, centre + half, 21, dtype=torch.float64)
        q, dq, ddq = trajectory.roll_out(c, times[10:11])[1:]
        motion = cell_motion(dq[:, 0], ddq[:, 0], jerk, half)
        outside, inside = slack.here(q[:, 0], asked, motion)
        assert (outside <= slack.of(motion, half)["collision"][tuple(asked.T)] + 1e-12).all()
        samples = trajectory.roll_out(c, times).position
        capsules, pieces = [], []
        for t in range(len(times)):
            still = torch.zeros_like(samples[:, t])
            margins = constraints.capsule_margins(samples[:, t], still, still)["collision"]
            capsules.append(margins[tuple(asked.T)])
            pieces.append(constraints.pieces.lower(samples[:, t], asked))
        for bound, seen in ((outside, torch.stack(capsules)), (inside, torch.stack(pieces))):
            clear = seen.isfinite().all(0)
            change = (seen - seen[10]).abs().amax(0)
            assert (change[clear] <= bound[clear] + 1e-7).all()


@given(st.integers(2, 6), seeds)
def test_both_searches_look_inside_alike(joints: int, seed: int) -> None:
    pytest.importorskip("numba")
    arm = filled(random_chain(joints, seed % 100)[0], seed)
    constraints, trajectory = constrained(arm, ()), Trajectory(joints, 3, 4.0)
    c = moderate(arm, trajectory, 8, seed)
    assert_same(constraints, trajectory, c, exact=False)


def test_looking_inside_finds_valid_what_capsules_refuse(arm: Arm) -> None:
    full = filled(arm, 1)
    trajectory = Trajectory(7)
    c = moderate(arm, trajectory, 60, 3)
    with_capsules = check(Constraints(arm), trajectory, c).valid
    inside = check(Constraints(full), trajectory, c).valid
    assert (inside >= with_capsules).all() and inside.sum() > with_capsules.sum()
    search = Search(Constraints(full), trajectory, c)
    search.run()
    assert torch.equal(search.result()[0], inside)
