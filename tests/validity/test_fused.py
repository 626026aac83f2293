"""The compiled search agrees with the plain one on everything, to rounding: random arms, regions, motions."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, Convex, Plane, check
from sidegan.validity.bounds import CellMotion, torque_bounds
from sidegan.validity.search import Search
from tests.chains import constrained, random_chain
from tests.threads import several_threads

from .critical import BALL, BOX, DESK, HULL, limited, moderate

pytest.importorskip("numba")

REGIONS = {
    "none": (),
    "desk": (DESK,),
    "box": (BOX,),
    "round": (BALL, HULL),
    "all": (Plane((0.3, -0.2, 0.9), -0.5), BOX, DESK, Convex.box((0.5, 0.3, 0.2))),
}


def assert_same(constraints: Constraints, trajectory: Trajectory, c: Tensor, exact: bool = True) -> Tensor:
    """Both searches end with the same verdicts, margins, elements and times; the verdicts come back.

    The margins are those at the times where these are exact: no lower bounds of distances.
    """
    from sidegan.validity.fused import FusedSearch

    plain, fused = Search(constraints, trajectory, c), FusedSearch(constraints, trajectory, c)
    for search in (plain, fused):
        search.run()
    (valid, *expected), (verdict, *result) = plain.result(), fused.result()
    clear = torch.stack(list(expected[0].values())).abs().amin(0) > 1e-9  # elsewhere rounding decides
    assert valid[clear].tolist() == verdict[clear].tolist()
    for name, margin in expected[0].items():
        torch.testing.assert_close(result[0][name], margin, rtol=1e-9, atol=1e-9)
        states = (trajectory.derivative(c, result[2][name], order) for order in range(constraints.orders))
        at = [x.diagonal().T for x in states]  # each trajectory at its own time
        own = constraints.margins(*at)[name].gather(1, result[1][name][:, None])[:, 0]
        sampled = torch.isclose(own, margin, rtol=1e-9, atol=1e-9)
        if exact:
            assert (sampled | (margin < 0)).all()  # else it is a guaranteed one, below zero
    return valid


@settings(max_examples=25, deadline=None)
@given(
    joints=st.integers(1, 9),
    seed=st.integers(0, 10_000),
    regions=st.sampled_from(sorted(REGIONS)),
    period=st.sampled_from([0.7, 3.0, 8.05]),
    limit=st.sampled_from([torch.inf, 30.0, 300.0]),
    higher=st.sets(st.sampled_from(["acceleration", "jerk"])),
)
def test_both_searches_agree_on_random_arms(joints, seed, regions, period, limit, higher):
    arm = limited(random_chain(joints, seed)[0], sorted(higher), share=0.3)
    torque = torch.full((joints,), limit, dtype=torch.float64)
    torque[::2] = 150.0
    arm = replace(arm, torque_limit=torque)
    trajectory = Trajectory(joints, 4, period, ((arm.position_lower + arm.position_upper) / 2).tolist())
    constraints = constrained(arm, REGIONS[regions], torque=seed % 3 > 0)
    assert_same(constraints, trajectory, moderate(arm, trajectory, 12, seed))


@pytest.mark.parametrize("seed", range(3))
def test_both_bound_alike_how_torques_change(seed: int) -> None:
    """Whichever way gravity pulls: here it does so in a new direction each time."""
    from sidegan.motion.compiled import cells
    from sidegan.validity.fused import model_of

    arm = random_chain(4, seed)[0]
    most = torch.rand(6, 4, generator=torch.Generator().manual_seed(seed), dtype=torch.float64).numpy()
    none = np.zeros((1, 4, 2)), np.zeros((1, 5, 2)), np.zeros(1)
    drifts = np.zeros((2, 1, 4))
    drifts[0, 0] = most[5]
    motions = cells.Motions(none[0], most[4:5].copy(), drifts, none[1], none[2], 0.1)
    bent = np.zeros((2, 4))
    cells.bend_torques(model_of(Constraints(arm)), most[:4].copy(), motions, 0, np.zeros((6, 4)), bent)
    expected = torque_bounds(arm, CellMotion(*torch.from_numpy(most)[:, None]))
    np.testing.assert_allclose(bent, torch.cat(expected), rtol=1e-12)


@settings(max_examples=15, deadline=None)
@given(joints=st.integers(2, 6), seed=st.integers(0, 10_000), clearance=st.sampled_from([0.0, 0.05, 0.2]))
def test_both_searches_agree_on_balls_that_keep_a_distance(joints: int, seed: int, clearance: float) -> None:
    """Where what surrounds a link is no larger than the link, nothing may be skipped too early."""
    arm = random_chain(joints, seed)[0]
    middles = (arm.capsules.a + arm.capsules.b) / 2
    arm = replace(arm, capsules=replace(arm.capsules, a=middles, b=middles))
    trajectory = Trajectory(joints, 4, 3.0, ((arm.position_lower + arm.position_upper) / 2).tolist())
    constraints = constrained(arm, (), clearance=clearance)
    assert_same(constraints, trajectory, moderate(arm, trajectory, 12, seed))


def test_threads_change_nothing(arm: Arm) -> None:
    constraints, trajectory = Constraints(arm, [DESK]), Trajectory(7)
    c = moderate(arm, trajectory, 41, seed=2)
    alone = check(constraints, trajectory, c)
    with several_threads(3):
        shared = check(constraints, trajectory, c)
    assert torch.equal(alone.valid, shared.valid)
    for name in alone.margins:
        torch.testing.assert_close(alone.margins[name], shared.margins[name], rtol=0, atol=1e-14)
        assert torch.equal(alone.elements[name], shared.elements[name])


def test_families_of_one_arm_keep_their_own_home(planar: Arm) -> None:
    constraints = Constraints(planar, [DESK])
    for home in ((0.0, 0.0), (0.4, -0.8), (-0.2, 0.1)):
        trajectory = Trajectory(2, 3, 4.0, home)
        assert_same(constraints, trajectory, moderate(planar, trajectory, 20, seed=3))
