"""Constraints of single states: which apply, what their margins are, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import InfeasibleError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.validity import Box, Constraints
from tests.chains import random_states

from .critical import BENT, DESK, limited, only


def test_exempt_pairs_are_stated(arm: Arm) -> None:
    said = Constraints(arm, [DESK]).described()
    assert "20 of 21 pairs of links (may touch: link_5 – link_7 (the wrist, touch in 100 %))" in said
    assert "6 of 7 links against 1 region (always inside: link_1 in region 0)" in said
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


@pytest.mark.parametrize("count", [0, 1, 2])
def test_arms_with_few_capsules_have_few_constraints(planar: Arm, count: int) -> None:
    bare = replace(planar, capsules=only(planar.capsules, np.arange(count)))
    constraints = Constraints(bare, [DESK])
    expected = {"position", "velocity", "torque"} | ({"keep_out"} if count == 2 else set())
    states = random_states(planar, 4)
    assert set(constraints.labels) == set(constraints.margins(*states)) == expected


@pytest.mark.parametrize("beyond", [1e-6, -1e-6])
def test_a_home_may_be_close_to_a_limit_but_not_beyond(planar: Arm, beyond: float) -> None:
    home, constraints = [float(planar.position_upper[0]) + beyond, 0.0], Constraints(planar)
    if beyond > 0:
        with pytest.raises(InfeasibleError, match=r"position of .*: margin -1e-06$"):
            constraints.refuse_home(home)
    else:
        constraints.refuse_home(home)


def test_acceleration_and_jerk_limits_are_constraints(arm: Arm) -> None:
    constraints = Constraints(limited(arm, ["acceleration", "jerk"]))
    said = constraints.described()
    assert said.startswith("position and velocity of 7 joints, acceleration of 5, jerk of 5, torque of 7; ")
    assert list(constraints.labels)[:4] == ["position", "velocity", "acceleration", "jerk"]
    still = np.zeros((1, 7))
    margins = constraints.margins(still, still, 1 - still, -2 - still)
    assert margins["acceleration"][0, 0] == pytest.approx(8 * float(arm.velocity_limit[0]) - 1)
    assert margins["jerk"][0, 1] == pytest.approx(60 * float(arm.velocity_limit[1]) - 2)
    assert margins["jerk"][0, 2] == np.inf
    shares = constraints.relative(margins, 1.0)
    assert shares["jerk"][0, 2] == 1 and shares["acceleration"][0, 0] < 1
    constraints.refuse_home(BENT)
    none = np.full((7,), np.inf, dtype=float)
    assert Constraints(replace(arm, acceleration_limit=none, jerk_limit=none)).higher == {}
