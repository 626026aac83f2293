"""What is inside of capsules: distances against coal, the two ways to find them, and the proof by them."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check
from sidegan.validity.bounds import Slack, cell_motion
from sidegan.validity.hulls import apart
from sidegan.validity.moving import Moving
from sidegan.validity.search import Search
from tests.chains import constrained, random_chain, random_states

from .critical import cells, filled, moderate, only
from .test_fused import assert_same

seeds = st.integers(0, 10**6)


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


def placements(random: np.random.Generator, count: int, far: float) -> tuple[np.ndarray, np.ndarray]:
    turns = np.array([pin.exp3(random.normal(size=3) * 2) for _ in range(count)])
    return turns, far * random.normal(size=(count, 3))


@given(seeds)
def test_distance_of_hulls_is_that_of_coal(seed: int) -> None:
    random = np.random.default_rng(seed)
    one, other = hull(random), hull(random)
    turns, places = placements(random, 20, 0.3)
    first, second, still = convex(one), convex(other), coal.Transform3s()
    asked = ((coal.DistanceRequest(), coal.DistanceResult()) for _ in turns)
    there = map(coal.Transform3s, turns, places)
    expected = np.array([coal.distance(first, still, second, x, *own) for x, own in zip(there, asked)])
    found = apart((one, np.tile(np.eye(3), (20, 1, 1)), np.zeros((20, 3))), (other, turns, places))
    touching = expected < -1e-6
    assert np.isneginf(found[touching]).all()
    clear = expected > 1e-6
    np.testing.assert_allclose(found[clear], expected[clear], rtol=0, atol=2e-6)  # coal's own is 1e-6


@settings(max_examples=50)
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
        matrix, room = tuple(map(tuple, turn)), np.zeros((6, 4))
        found = kernel.apart(hulls, (0, 1), matrix, tuple(place), tuple(-place), np.inf, room)
        assert np.isfinite(found) == np.isfinite(distance)
        if np.isfinite(found):
            assert found == pytest.approx(distance, abs=2e-8)
            enough = kernel.apart(hulls, (0, 1), matrix, tuple(place), tuple(-place), distance / 2, room)
            assert distance / 2 - 1e-12 <= enough <= distance + 2e-8


@settings(max_examples=25)
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


@pytest.mark.parametrize("half", [0.05, 0.0005])
@pytest.mark.parametrize("seed", range(3))
def test_no_pair_comes_nearer_in_a_cell_than_its_bound(seed: int, half: float) -> None:
    arm, sharp = filled(random_chain(5, seed)[0], seed), []
    constraints, trajectory = constrained(arm, ()), Trajectory(5, 3, 3.0)
    c = 0.5 * moderate(arm, trajectory, 6, seed)
    asked = torch.cartesian_prod(torch.arange(6), torch.nonzero(constraints.pieces.finer)[:, 0])
    for times, *states, motion in cells(trajectory, c, half):
        capsules, pieces = [], []
        for q in trajectory.roll_out(c, times).position.unbind(1):
            capsules.append(constraints.capsule_margins(q, 0 * q, 0 * q)["collision"][tuple(asked.T)])
            pieces.append(constraints.pieces.lower(q, asked))
        capsules, pieces = torch.stack(capsules), torch.stack(pieces)
        pairs = Moving(constraints.pieces, Slack(constraints), *states, motion, half)
        for bound, seen in ((pairs.capsules(asked), capsules), (pairs.inside(asked), pieces)):
            clear = seen.isfinite().all(0)
            assert clear.any() and (bound[clear] <= seen.amin(0)[clear] + 1e-7).all()
        change = (motion.position_change[asked[:, 0]] * pairs.slack.pair_reach[asked[:, 1]]).sum(1)
        sharp.append(((capsules[10] - pairs.capsules(asked)) / change)[(capsules[10] > 0.02) & (change > 0)])
    if half < 0.01:  # what is left is how paths bend, and what joints' motion does not do along the line
        assert torch.cat(sharp).median() < 0.5


@pytest.mark.parametrize("angle", [1.0, 1.5, 2.0, 2.3, 2.5, -1.0, -2.4])
def test_a_turning_forearm_comes_hardly_nearer(angle: float, planar: Arm) -> None:
    """Against the distances at both ends of the cell: it turns evenly, and the base rests."""
    constraints = Constraints(replace(planar, capsules=only(planar.capsules, torch.tensor([0, 2]))))
    half, speed = 1e-4, 1.5
    q, dq = (torch.tensor([[0.0, x]], dtype=torch.float64) for x in (angle, speed))
    motion = cell_motion(dq, *[torch.zeros_like(dq)] * 3, half)
    pairs = Moving(constraints.pieces, Slack(constraints), q, dq, motion, half)
    bound = float(pairs.capsules(torch.tensor([[0, 0]])))
    now, *ends = (
        float(constraints.at_rest(torch.tensor([[0.0, there]], dtype=torch.float64))["collision"])
        for there in (angle, angle + speed * half, angle - speed * half)
    )
    assert bound <= min(ends)
    if abs(angle) < 1.6:  # the elbow is nearest, and rests too: what is left is the bend of the path
        assert bound == pytest.approx(now, abs=1e-8)


@settings(max_examples=20)
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
