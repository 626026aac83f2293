"""Constraints of single states: which apply, their margins, what links keep clear of, and what is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import InfeasibleError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Box, Constraints, Plane
from tests.chains import random_states
from tests.refusals import refused
from tests.robot.test_cases import arm_of, inertial
from tests.robot.urdf import collision

from .critical import BALL, BENT, BOX, DESK, HULL, limited, moderate, only
from .test_search import assert_bounded, assert_sound, shaped


def test_exempt_pairs_are_stated(arm: Arm) -> None:
    said = Constraints(arm, [DESK]).described()
    assert "20 of 21" in said and "link_5 – link_7 (the wrist" in said
    assert "6 of 7" in said and "link_1 in region 0" in said
    bare = replace(arm, capsules=only(arm.capsules, np.arange(4)))
    assert "without a shape" in Constraints(bare).described()


def test_links_always_inside_a_region_are_exempt_from_that_region_only(arm: Arm) -> None:
    """The base does not move, and link 1 only turns in place."""
    constraints = Constraints(arm, [DESK, Box((1.0, -0.1, 0.0), (1.2, 0.1, 0.4))])
    assert constraints.guarded.tolist() == [[0, k] for k in range(2, 8)] + [[1, k] for k in range(1, 8)]
    assert constraints.labels["keep_out"][0] == "link_2 in region 0"


def test_margins_are_distances_from_the_limits(planar: Arm) -> None:
    q, dq, ddq = random_states(planar, 50)
    margins = Constraints(planar).margins(q, dq, ddq)
    left = np.minimum(q - np.array([-2.6, -2.9]), np.array([2.6, 2.9]) - q)
    np.testing.assert_allclose(margins["position"], left, atol=1e-9)
    np.testing.assert_allclose(margins["velocity"], np.array([3.0, 4.0]) - np.abs(dq), atol=1e-9)
    torque = np.abs(RigidBody(planar).torque(q, dq, ddq))
    np.testing.assert_allclose(margins["torque"], np.array([200.0, 100.0]) - torque, atol=1e-9)


def test_margins_of_the_upright_planar_arm(planar: Arm) -> None:
    """The forearm's axis begins 0.9 m up, 0.4 m above the base sphere's centre."""
    upright = np.zeros((1, 2))
    margins = Constraints(planar, [DESK]).at_rest(upright)
    assert margins["collision"].item() == pytest.approx(0.4 - 0.1 - 0.04)
    assert margins["keep_out"][0].tolist() == pytest.approx([0.5 - 0.05 - 0.1, 0.9 - 0.04 - 0.1])


def test_torque_is_constrained_only_where_limited_and_requested(planar: Arm) -> None:
    free = replace(planar, torque_limit=np.array([np.inf, np.inf]))
    half = replace(planar, torque_limit=np.array([np.inf, 3.0]))
    assert "torque" in Constraints(planar).labels
    assert "torque" not in Constraints(planar, torque=False).labels
    assert "torque" not in Constraints(free).labels
    constraints, q = Constraints(half, [DESK]), np.array([[0.1, -0.2], [0.3, 0.4]])
    margins = constraints.margins(q, q, q)
    shares = constraints.relative(margins, 0.1)
    assert (margins["torque"][:, 0] == np.inf).all() and (shares["torque"][:, 0] == 1).all()
    np.testing.assert_allclose(shares["torque"][:, 1], margins["torque"][:, 1] / 3.0, atol=1e-9)
    np.testing.assert_allclose(shares["keep_out"], margins["keep_out"] / 0.1, atol=1e-9)
    assert all(np.isfinite(share).all() for share in shares.values())


@pytest.mark.parametrize("beyond", [1e-6, -1e-6])
def test_a_home_may_be_close_to_a_limit_but_not_beyond(planar: Arm, beyond: float) -> None:
    home, constraints = [float(planar.position_upper[0]) + beyond, 0.0], Constraints(planar)
    if beyond > 0:
        with refused(InfeasibleError, "position of shoulder", "-1e-06"):
            constraints.refuse_home(home)
    else:
        constraints.refuse_home(home)


def test_acceleration_and_jerk_limits_are_constraints(arm: Arm) -> None:
    constraints = Constraints(limited(arm, ["acceleration", "jerk"]))
    said = constraints.described()
    assert all(limit in said for limit in ("acceleration of 5", "jerk of 5", "torque of 7"))
    assert list(constraints.labels)[:4] == ["position", "velocity", "acceleration", "jerk"]
    still = np.zeros((1, 7))
    margins = constraints.margins(still, still, 1 - still, -2 - still)
    assert margins["acceleration"][0, 0] == pytest.approx(8 * float(arm.velocity_limit[0]) - 1)
    assert margins["jerk"][0, 1] == pytest.approx(60 * float(arm.velocity_limit[1]) - 2)
    assert margins["jerk"][0, 2] == np.inf
    shares = constraints.relative(margins, 1.0)
    assert shares["jerk"][0, 2] == 1 and shares["acceleration"][0, 0] < 1
    constraints.refuse_home(BENT)
    none = np.full(7, np.inf)
    assert Constraints(replace(arm, acceleration_limit=none, jerk_limit=none)).higher == {}


FAR = 0.04  # [m]


@pytest.mark.parametrize(
    ("regions", "clearance", "apart"),
    [
        ([], FAR, FAR),
        ([DESK], FAR, 0.0),
        ([BOX, DESK], 0.005, 0.005),
        ([BALL], FAR, 0.01),
        ([BOX, BALL], 0.0, 0.02),
        ([HULL, DESK], 0.005, 0.005),
        ([Box((0.4, -0.3, 0.1), (0.8, 0.3, 0.5))], FAR, FAR),
    ],
)
def test_margins_are_distances_beyond_the_clearance(arm: Arm, regions, clearance, apart) -> None:
    plain, clear = Constraints(arm, regions), Constraints(arm, regions, clearance=clearance, apart=apart)
    states = random_states(arm, 200)
    before, after = plain.margins(*states), clear.margins(*states)
    assert set(before) == set(after)
    np.testing.assert_allclose(after["position"], before["position"], atol=1e-9)
    boxes = any(isinstance(region, Box) for region in regions)  # which keep a little more at their edges
    if regions:
        excess = before["keep_out"] - clearance - after["keep_out"]
        most = (3**0.5 - 1) * max(clearance - apart / 2, 0.0) if boxes else 0.0
        assert excess.min() >= -1e-9 and excess.max() <= most + 1e-9
    shared = [clear.labels["collision"].index(x) for x in plain.labels["collision"]]
    np.testing.assert_allclose(after["collision"][:, shared], before["collision"] - apart, atol=1e-9)
    trajectory = Trajectory(7, 6, 16.0, BENT)
    assert_sound(clear, trajectory, 0.4 * moderate(arm, trajectory, 4, seed=1))
    if not boxes:
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
    assert 0.1 < valid.mean() < 0.9


def offered(error: InfeasibleError) -> float:
    """The clearance above zero that a refusal offers after the one that is too large."""
    found = float(re.findall(r"clearance=([\d.]+)", str(error))[-1])
    assert found > 0
    return found


def test_an_impossible_clearance_is_refused_with_the_pair(arm: Arm, planar: Arm) -> None:
    with refused(InfeasibleError, "clearance=0.6", "base – forearm") as caught:
        Constraints(planar, clearance=0.6)
    assert "may_touch" not in str(caught.value)
    Constraints(planar, clearance=offered(caught.value))
    low = [Box((-1, -1, 0), (1, 1, 0.35))]
    with refused(InfeasibleError, "clearance=0.2", "upper_arm in region 0") as caught:
        Constraints(planar, low, clearance=0.2)
    Constraints(planar, low, clearance=offered(caught.value))
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
    assert all(words in clear.described() for words in ("0.2 m", "0.1 m", "upper_arm in region 0"))
    assert_sound(clear, Trajectory(2), 0.3 * moderate(planar, Trajectory(2), 30, seed=3))


def test_a_plane_through_the_origin_may_have_a_normal_of_any_length(arm: Arm) -> None:
    unit, longer = Plane((0.0, 0.6, 0.8), 0.0), Plane((0.0, 3.0, 4.0), 0.0)
    states = random_states(arm, 50)
    kept = [Constraints(arm, [plane], clearance=FAR).margins(*states)["keep_out"] for plane in (unit, longer)]
    np.testing.assert_allclose(*kept, atol=1e-9)
