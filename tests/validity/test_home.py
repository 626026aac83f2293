"""Default home position and effort, and the check of straight paths."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.errors import ConfigError, InfeasibleError
from sidegan.robot import Arm, load_robot
from sidegan.validity import Constraints, Plane, default_home, usual_effort
from sidegan.validity.check import require_straight
from sidegan.validity.home import refuse_degrees

from .critical import holding


def bent_arm(lower: float = 0.5) -> Arm:
    """The planar arm whose first joint may be between that and 1.5 rad."""
    arm = load_robot("planar2")
    limits = np.stack([arm.position_lower, arm.position_upper])
    limits[:, 0] = np.array([lower, 1.5])
    return replace(arm, position_lower=limits[0], position_upper=limits[1])


@pytest.mark.parametrize("name", ["planar2", "kuka_lwr4"])
def test_a_feasible_zero_position_stays_home(name):
    assert default_home(Constraints(load_robot(name), [Plane((0, 0, 1), 0.1)])) is None


@pytest.mark.parametrize("lower", [0.0, 0.5])
def test_home_is_mid_range_where_zero_is_infeasible(lower):
    assert default_home(Constraints(bent_arm(lower))) == pytest.approx(((lower + 1.5) / 2, 0), abs=1e-3)


def test_home_is_a_free_position_near_mid_range():
    bent, regions = bent_arm(), [Plane((0, 0, 1), 0.7)]  # the elbow is too low in the middle
    with pytest.raises(InfeasibleError, match="keep_out of forearm"):
        Constraints(bent, regions).refuse_home((1, 0))
    home = default_home(Constraints(bent, regions))
    Constraints(bent, regions).refuse_home(home)
    middle, half = (bent.position_lower + bent.position_upper) / 2, bent.position_upper - bent.position_lower
    assert (np.abs(np.array(home) - middle) / half).max() < 0.15
    assert default_home(Constraints(bent, regions)) == home


@pytest.mark.parametrize("positions", [[0.0, -90.0, 90.0, 0.0, 45.0, 0.0, 0.0], [120.0] + 6 * [0.0]])
def test_positions_in_degrees_are_refused_with_radians(arm, positions):
    with pytest.raises(ConfigError, match=r"has -?\d+ for .* are these degrees\?") as told:
        refuse_degrees(arm, positions, "trajectory.home")
    said = str(told.value).rpartition("trajectory.home=[")[2].removesuffix("]'")
    refuse_degrees(arm, radians := [float(x) for x in said.split(",")], "trajectory.home")
    assert radians == pytest.approx([math.radians(x) for x in positions], abs=1e-3)
    with pytest.raises(ConfigError, match="are these degrees"):
        usual_effort(arm, positions)


@pytest.mark.parametrize(
    ("share", "home", "expected"),
    [
        (0.79, None, 0.8),
        (0.79, (math.pi / 2, 0.0), 0.8),
        (0.801, None, 0.8),  # held nearly everywhere
        (0.801, (math.pi / 2, 0.0), 1.0),  # but not at home
        (0.99, None, 1.0),
        (0.99, (0.0, 0.0), 1.0),
        (0.0, None, 0.8),  # without torque limits
    ],
)
def test_a_first_run_uses_reduced_effort_if_that_holds_the_arm(planar, share, home, expected):
    assert usual_effort(holding(planar, share), home) == expected


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), reach=st.floats(0.1, 1.0))
def test_the_straight_path_check_agrees_with_dense_sampling(arm, seed, reach):
    desk = Constraints(arm, [Plane(normal=(0, 0, 1), offset=0.1)], torque=False)
    generator = np.random.default_rng(seed)
    share = generator.random((2, arm.joints)) - 0.5
    middle, half = (arm.position_upper + arm.position_lower) / 2, arm.position_upper - arm.position_lower
    start, end = middle + reach * share * half
    grid = np.linspace(start, end, 1001)
    found = min(float(x.min()) for x in desk.at_rest(grid).values() if x.size)
    try:
        require_straight(desk, start.tolist(), end.tolist())
    except InfeasibleError as error:
        assert found < 1e-3 and "along it" in str(error)
    else:
        assert found >= 0
