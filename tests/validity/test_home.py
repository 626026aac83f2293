"""Default home and effort, straight paths, and what cannot be checked, which is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.errors import ConfigError, InfeasibleError, RobotError, ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, Setup, load_robot
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere, check, default_home, usual_effort
from sidegan.validity.check import require_straight
from sidegan.validity.home import refuse_degrees
from tests.refusals import refused

from .critical import DESK, holding, limited, only
from .test_pairs import chain


def bent_arm(lower: float = 0.5) -> Arm:
    """The planar arm whose first joint may be between that and 1.5 rad."""
    arm, limits = load_robot("planar2"), np.array([[lower, -2.9], [1.5, 2.9]])
    return replace(arm, position_lower=limits[0], position_upper=limits[1])


@pytest.mark.parametrize("name", ["planar2", "kuka_lwr4"])
def test_a_feasible_zero_position_stays_home(name):
    assert default_home(Constraints(load_robot(name), [DESK])) is None


@pytest.mark.parametrize("lower", [0.0, 0.5])
def test_home_is_mid_range_where_zero_is_infeasible(lower):
    assert default_home(Constraints(bent_arm(lower))) == pytest.approx(((lower + 1.5) / 2, 0), abs=1e-3)


def test_home_is_a_free_position_near_mid_range():
    bent, regions = bent_arm(), [Plane((0, 0, 1), 0.7)]  # the elbow is too low in the middle
    with refused(InfeasibleError, "keep_out of forearm"):
        Constraints(bent, regions).refuse_home((1, 0))
    home = default_home(Constraints(bent, regions))
    Constraints(bent, regions).refuse_home(home)
    middle, half = (bent.position_lower + bent.position_upper) / 2, bent.position_upper - bent.position_lower
    assert (np.abs(np.array(home) - middle) / half).max() < 0.15
    assert default_home(Constraints(bent, regions)) == home


def test_a_link_of_several_parts_is_named_by_what_all_of_them_violate():
    """The last part is a ball at the elbow, within the forearm: it is in the way less often."""
    arm = bent_arm()
    capsules, parts = arm.capsules, [0, 1, 2, 2]
    more = replace(only(capsules, np.array(parts)), b=np.vstack([capsules.b, capsules.a[2:]]))
    for same in (arm, replace(arm, capsules=more)):
        with refused(InfeasibleError, "90% of them violate keep_out of forearm in region 1"):
            default_home(Constraints(same, BETWEEN))


@pytest.mark.parametrize("positions", [[0.0, -90.0, 90.0, 0.0, 45.0, 0.0, 0.0], [120.0] + 6 * [0.0]])
def test_positions_in_degrees_are_refused_with_radians(arm, positions):
    with refused(ConfigError, "home", "rad") as caught:
        refuse_degrees(arm, positions, "trajectory.home")
    said = str(caught.value).rpartition("home=[")[2].removesuffix("]")
    refuse_degrees(arm, radians := [float(x) for x in said.split(",")], "trajectory.home")
    assert radians == pytest.approx([math.radians(x) for x in positions], abs=1e-3)
    with refused(ConfigError, "home", "rad"):
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
    desk = Constraints(arm, [DESK], torque=False)
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


ARM, PLANAR = load_robot("kuka_lwr4"), load_robot("planar2")
THICK = replace(ARM, capsules=replace(ARM.capsules, radius=1000.0 * ARM.capsules.radius))
WALL = Plane((1, 0, 0), -0.5)
HUGE = Box((-3.0, -3.0, -3.0), (3.0, 3.0, 3.0))
BETWEEN = [Plane((0, 0, 1), 0.7), Plane((0, 0, -1), -0.75)]  # each of which leaves room
POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])


def home(*position, arm=PLANAR):
    return lambda _: Constraints(arm, [DESK]).refuse_home(position)


def weak(arm, *limits):
    return replace(arm, torque_limit=np.array(limits, float))


def margins(*shapes, arm=ARM):
    return lambda _: Constraints(arm).margins(*(np.zeros(shape) for shape in shapes))


def checked(trajectory, shape, last=0.0):
    def run(_):
        c = np.zeros(shape)
        c[-1, -1, -1, -1] = last
        check(Constraints(ARM), trajectory, c)

    return run


def straight(start, end=(0.0, 0.0), regions=()):
    return lambda _: require_straight(Constraints(PLANAR, regions), list(start), list(end))


def touching(**setup):
    def run(folder):
        (folder / "arm.urdf").write_text(chain(0.31))
        Constraints(load_robot(folder / "arm.urdf", Setup(**setup)))

    return run


# What is done in an empty folder, and the names and numbers that the refusal is about.
REFUSED = {
    ConfigError: [
        (lambda _: Plane((0.0, 0.0, 0.0), 0.1), ("Plane",)),
        (lambda _: Plane((0.0, math.nan, 1.0), 0.1), ("Plane",)),
        (lambda _: Plane((0.0, 0.0, 1.0), math.inf), ("Plane",)),
        (lambda _: Plane((1.0, 1.0, 0.0), -0.3), ("Plane", "1.414", "[0.707107, 0.707107, 0]")),
        (lambda _: Box((0.0, 0.0, 0.0), (1.0, 1.0, 0.0)), ("Box",)),
        (lambda _: Box((0.0, 0.0, 0.0), (1.0, 1.0)), ("Box",)),
        (lambda _: Box((0.0, 0.0, -math.inf), (1.0, 1.0, 1.0)), ("Box",)),
        (lambda _: Sphere((0, 0, 0), 0.0), ("Sphere",)),
        (lambda _: Sphere((0, 0), 1.0), ("Sphere",)),
        (lambda _: Convex.between((0, 0, 0), (0, 0, 0), 1.0), ("cylinder", "(0, 0, 0)")),
        (lambda _: Convex.between((0, 0, 0), (0, 0, 1), -1.0), ("cylinder", "-1.0")),
        (lambda _: Convex.around(POINTS), ("obstacle",)),
        (lambda _: Convex.around(np.array([[0.0, 0], [1, 0], [0, 1], [1, 2]])), ("obstacle",)),
        (lambda _: Convex.around(np.ones(3)), ("obstacle",)),
        (lambda _: Convex.around(np.where(POINTS > 0, POINTS, math.inf)), ("obstacle",)),
    ],
    InfeasibleError: [
        (home(2.7, 0.0), ("[2.7, 0.0]", "of shoulder: margin -0.1;", "keep_out of forearm in region 0")),
        (home(0.0, -3.0), ("position of elbow: margin -0.1", "collision of base – forearm: margin -0.08")),
        (home(2.5, 0.0), ("keep_out of forearm in region 0: margin -0.28",)),
        (home(1.0, 0.0, arm=weak(PLANAR, 5, 100)), ("torque of shoulder",)),
        (
            lambda _: default_home(Constraints(bent_arm(), BETWEEN)),
            ("keep_out of", "workspace={'desk': None}"),
        ),
        (
            lambda _: default_home(Constraints(weak(bent_arm(), 1e-7, 1e-7))),
            ("torque of shoulder", "home=[…]", "effort=…"),
        ),
        (lambda _: Constraints(THICK), (ARM.name,)),
        (lambda _: Constraints(ARM, [DESK, Plane((0.0, 0.0, 1.0), 5.0)]), ("region 1",)),
        (lambda _: Constraints(ARM, [DESK, HUGE]), ("region 1",)),
        (straight([0.0, 0.0], [-2.0, 0.0], [WALL]), ("keep_out of", "% along it")),
        (straight([0.0, 0.0], [3.0, 0.0], [WALL]), ("position of shoulder",)),
        (touching(may_touch=[("three", "one")]), ("may_touch=[['one', 'three'], ['base', 'two']]",)),
    ],
    RobotError: [(touching(may_touch=[("base", "tow")]), ("'tow'", "two"))],
    ShapeError: [
        (home(0.0), ("[0.0]", "2 finite")),
        (home(0.0, math.nan), ("[0.0, nan]", "2 finite")),
        (lambda _: usual_effort(PLANAR, [0.1]), ("[0.1]", "2 finite")),
        (straight([math.nan, 0.0]), ("2 finite",)),
        (margins(*[(3, 6)] * 3), ("3 times (N, 7)",)),
        (margins((3, 7), (2, 7), (3, 7)), ("3 times (N, 7)",)),
        (margins((1, 7), (1, 7), (1, 7), (1, 6)), ("3 times (N, 7)",)),
        (margins(*[(1, 7)] * 3, arm=limited(ARM, ["jerk"])), ("4 times (N, 7)",)),
        (checked(Trajectory(2), (1, 2, 6, 2)), ("2 joints", "7")),
        (checked(Trajectory(7), (1, 7, 5, 2)), ("(B, 7, 6, 2)",)),
        (checked(Trajectory(7), (2, 7, 6, 2), math.inf), ("coefficients[1]",)),
    ],
}
CASES = [(error, case, names) for error, cases in REFUSED.items() for case, names in cases]


@pytest.mark.parametrize(("error", "case", "names"), CASES, ids=[" ".join(names) for *_, names in CASES])
def test_is_refused(error, case, names, tmp_path):
    with refused(error, *names):
        case(tmp_path)
