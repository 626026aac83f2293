"""A clearance: links stay that far from each other and from every kind of region, provably."""

import numpy as np
import pytest

from sidegan.errors import InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Box, Constraints, Plane
from tests.chains import random_states
from tests.robot.test_cases import arm_of, inertial
from tests.robot.urdf import collision

from .critical import BALL, BENT, BOX, DESK, HULL, moderate
from .test_search import assert_bounded, assert_sound, shaped

FAR = 0.04  # [m]


@pytest.mark.parametrize(
    ("regions", "clearance", "apart"),
    [
        ([], FAR, FAR),
        ([DESK], FAR, 0.0),
        ([BOX, DESK], 0.005, 0.005),
        ([BALL], FAR, 0.01),
        ([HULL, DESK], 0.005, 0.005),
    ],
)
def test_margins_are_distances_beyond_the_clearance(arm: Arm, regions, clearance, apart) -> None:
    plain, clear = Constraints(arm, regions), Constraints(arm, regions, clearance=clearance, apart=apart)
    states = random_states(arm, 200)
    before, after = plain.margins(*states), clear.margins(*states)
    assert set(before) == set(after)
    np.testing.assert_allclose(after["position"], before["position"], atol=1e-9)
    if regions and BOX not in regions:  # whose corners keep a little more
        np.testing.assert_allclose(after["keep_out"], before["keep_out"] - clearance, atol=1e-9)
    shared = [clear.labels["collision"].index(x) for x in plain.labels["collision"]]
    np.testing.assert_allclose(after["collision"][:, shared], before["collision"] - apart, atol=1e-9)
    trajectory = Trajectory(7, 6, 16.0, BENT)
    assert_sound(clear, trajectory, 0.4 * moderate(arm, trajectory, 4, seed=1))
    if BOX not in regions:
        shown = [x.nearest(states[0])[0] for x in (plain, clear)]
        np.testing.assert_allclose(*shown, atol=1e-9)


@pytest.mark.parametrize("shape", ["capsules", "hulls"])
def test_tight_pairs_keep_a_smaller_clearance(arm: Arm, shape) -> None:
    shaped_arm = shaped(arm, shape, seed=0)
    plain, q = Constraints(shaped_arm), random_states(arm, 8000)[0]
    nearest = plain.at_rest(q)["collision"].min(0).argsort()
    tight = {plain.owners[nearest[0]]: 0.01}
    clear = Constraints(shaped_arm, clearance=FAR, tight=tight)
    shared = [clear.pairs.tolist().index(pair) for pair in plain.pairs.tolist()]
    gaps = np.array([tight.get(links, FAR) for links in plain.owners])
    before, after = plain.at_rest(q)["collision"], clear.at_rest(q)["collision"][:, shared]
    near = before < FAR  # what is farther may be a lower bound
    np.testing.assert_allclose(after[near], (before - gaps)[near], atol=1e-9)
    assert (near & (gaps < FAR)).any() and (near & (gaps == FAR)).any()
    trajectory = Trajectory(7, 6, 16.0, BENT)
    c = 0.4 * moderate(arm, trajectory, 8, seed=1)
    assert_sound(clear, trajectory, c, exact=shape != "hulls")
    near = Constraints(shaped_arm, clearance=FAR, tight=dict.fromkeys(plain.owners, 0.01))
    assert "collision" in assert_bounded(near, trajectory, c, half=0.05)


def test_hulls_of_tight_pairs_keep_a_smaller_clearance(load) -> None:
    plate = inertial() + collision('<box size="0.25 0.02 0.22"/>', 'xyz="0 0 0.15"')
    arm = load(arm_of({k: plate for k in range(4)}))
    owners = Constraints(arm).owners
    near = Constraints(arm, clearance=0.2, tight=dict.fromkeys(owners, 0.01))
    assert near.bodies.hulls.finer.all()
    trajectory = Trajectory(4, 4, 8.0)
    c = moderate(arm, trajectory, 200, seed=2)
    valid = assert_sound(near, trajectory, c, exact=False)
    assert 0.1 < valid.astype(float).mean() < 0.9


def test_the_clearance_of_boxes_is_a_little_larger_at_edges(arm: Arm) -> None:
    box = Box((0.4, -0.3, 0.1), (0.8, 0.3, 0.5))
    q = random_states(arm, 2000)[0]
    before, after = (Constraints(arm, [box], clearance=x).at_rest(q)["keep_out"] for x in (0.0, FAR))
    lost = before - after - FAR
    assert (lost >= -1e-9).all() and (lost <= (3**0.5 - 1) * FAR / 2 + 1e-9).all()


def test_an_impossible_clearance_is_refused_with_the_pair(arm: Arm, planar: Arm) -> None:
    with pytest.raises(InfeasibleError, match="is too large, these are always closer") as refused:
        Constraints(planar, clearance=0.6)
    assert "base – forearm" in str(refused.value) and "may_touch" not in str(refused.value)
    low = [Box((-1, -1, 0), (1, 1, 0.35))]
    with pytest.raises(InfeasibleError, match="always closer: upper_arm in region 0"):
        Constraints(planar, low, clearance=0.2)
    assert "0.04 m kept clear" in Constraints(arm, clearance=FAR).described()
    assert "kept clear" not in Constraints(arm).described()


def test_links_always_near_a_plane_only_keep_out_of_it(planar: Arm) -> None:
    low, q = Plane((0, 0, 1), 0.35), random_states(planar, 300)[0]
    plain, clear = Constraints(planar, [low]), Constraints(planar, [low], clearance=0.2, apart=0.1)
    assert plain.labels["keep_out"] == ("upper_arm in region 0", "forearm in region 0")
    assert clear.labels["keep_out"] == ("forearm in region 0", "upper_arm in region 0")
    before, after = plain.at_rest(q)["keep_out"], clear.at_rest(q)["keep_out"]
    np.testing.assert_allclose(after[:, 1], before[:, 0], atol=1e-9)
    np.testing.assert_allclose(after[:, 0], before[:, 1] - 0.2, atol=1e-9)
    words = "0.2 m from regions and 0.1 m between links (always closer: upper_arm in region 0) kept clear"
    assert words in clear.described()
    assert_sound(clear, Trajectory(2), 0.3 * moderate(planar, Trajectory(2), 30, seed=3))
