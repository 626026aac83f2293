from dataclasses import replace

import numpy as np
import pytest

from sidegan.design.problem import Coordinates, Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER
from sidegan.validity import Constraints
from tests.validity.critical import limited


def test_squared_length_is_the_mean_square_use_of_the_limits(planar_problem, random):
    coordinates = Coordinates.of(planar_problem)
    x = random.standard_normal((4, 2, 6))
    c = coordinates.coefficients(x)
    np.testing.assert_allclose(coordinates.points(c), x)
    arm, trajectory = planar_problem.constraints.arm, planar_problem.trajectory
    motion = trajectory.roll_out(c, trajectory.grid(4000))
    room = (arm.position_upper - arm.position_lower) / 2
    position = ((motion.position / room) ** 2).mean(1)
    velocity = ((motion.velocity / arm.velocity_limit) ** 2).mean(1)
    size = ((c / arm.velocity_limit[:, None, None]) ** 2).sum((2, 3))
    np.testing.assert_allclose((x**2).sum((1, 2)), (position + velocity + size).sum(1), rtol=1e-3, atol=0)


@pytest.mark.parametrize("reach", [0.2, 0.6])
@pytest.mark.parametrize("names", [[], ["acceleration", "jerk"]])
def test_each_joint_of_a_start_uses_the_reach(planar_problem, random, reach, names):
    """Of its tightest limit, accelerations and jerks among them, which also make points longer."""
    arm, trajectory = limited(planar_problem.constraints.arm, names, 0.05), planar_problem.trajectory
    problem = replace(planar_problem, constraints=Constraints(arm))
    coordinates = Coordinates.of(problem)
    c = coordinates.coefficients(coordinates.start(problem, 20, random, reach))
    np.testing.assert_allclose(problem.limit_use(c), np.full((20, 2), reach))
    limits = {0: arm.position_upper, 1: arm.velocity_limit}
    limits |= {DERIVATIVE_ORDER[name]: limit for name, limit in arm.higher_limits.items()}
    grid, expected = trajectory.grid(4000), np.full((20, 2), reach)
    used = [(np.abs(trajectory.derivative(c, grid, k)) / limit).max(1) for k, limit in limits.items()]
    np.testing.assert_allclose(np.stack(used).max(0), expected, rtol=0.1, atol=0)
    x = random.standard_normal((4, 2, 6))
    wider = coordinates.points(Coordinates.of(planar_problem).coefficients(x))
    if names:
        assert (wider**2).sum() > (x**2).sum()


def test_limit_use_is_relative_to_the_room_on_either_side_of_home(planar):
    high = planar.position_upper
    problem = Problem(Constraints(planar), Trajectory(2, 3, 8.0, (0.7 * high).tolist()), 24)
    c = np.random.default_rng(0).standard_normal((20, 2, 3, 2)) * 1e-3
    away = problem.trajectory.derivative(c, problem.trajectory.grid(4 * 24), 0) - 0.7 * high
    expected = np.maximum(away.max(1) / (0.3 * high), -away.min(1) / (1.7 * high))
    slow = replace(planar, velocity_limit=np.full_like(high, 1e9))
    np.testing.assert_allclose(replace(problem, constraints=Constraints(slow)).limit_use(c), expected)
