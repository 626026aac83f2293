"""The compiled evaluation of single trajectories against margins and fitness: random arms and motions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sidegan.design.goal import Goal
from sidegan.design.objective import Objective, evaluator
from sidegan.design.problem import HOPELESS, Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from tests.chains import constrained, driven, random_chain
from tests.validity.critical import limited

DESK = Plane((0.0, 0.0, 1.0), 0.1)
ROUND = (Sphere((0.5, 0.2, 0.3), 0.25), Convex.between((-0.5, -0.5, 0.0), (-0.4, -0.3, 0.6), 0.1))
REGIONS = ((), (DESK,), (DESK, Box((0.3, -0.4, -0.6), (0.8, 0.3, 0.4))), ROUND)


def states_of(problem, c):
    """Positions and as many derivatives as are limited at a problem's samples, (B, T, J) each."""
    family, times = problem.trajectory, problem.trajectory.grid(problem.samples)
    return [family.derivative(c, times, order) for order in range(problem.constraints.orders)]


def candidates(problem, count, seed=0, size=1.0):
    """Coefficients, (count, J, H, 2), of which some hold each constraint and some do not."""
    random = np.random.default_rng(seed)
    speed = problem.constraints.arm.velocity_limit
    share = random.uniform(0.01, size, (count, 1, 1, 1))
    return share * speed[:, None, None] * random.normal(size=(count, *problem.trajectory.shape))


def by_definition(problem, c):
    """Log fitness and violations, (B, 1 + G), from the problem's own."""
    constraints = problem.constraints
    margins = constraints.margins(*(part.reshape(-1, part.shape[2]) for part in states_of(problem, c)))
    shares = constraints.relative(margins, 1.0).values()
    violations = [-share.reshape(len(c), -1).min(1) for share in shares]
    return np.stack([np.log(problem.fitness(c)), *violations], 1)


def assert_same(problem, c):
    """Both give the same numbers; violations are positive for the same trajectories."""
    numbers, expected = evaluator(problem)(c), by_definition(problem, c)
    assert numbers.shape == expected.shape == (len(c), 1 + len(problem.constraints.labels))
    # The smallest eigenvalue is known to so many rounding errors of the largest.
    known = np.exp(expected[:, 0]) * 1e-13
    np.testing.assert_allclose(numbers[known < 1e-3, 0], expected[known < 1e-3, 0], rtol=0, atol=1e-3)
    excess = np.abs(numbers[:, 0] - expected[:, 0]) - 1e-9
    assert (excess[known < 1e-3] <= known[known < 1e-3]).all()
    np.testing.assert_allclose(numbers[:, 1:], expected[:, 1:], rtol=1e-9, atol=1e-9)
    clear = np.abs(expected[:, 1:]) > 1e-9  # elsewhere rounding decides
    assert ((numbers[:, 1:] > 0) == (expected[:, 1:] > 0))[clear].all()


@pytest.mark.parametrize("samples", [511, 512, 700])
def test_long_trajectories_are_evaluated_in_blocks_of_samples(planar, samples):
    problem = Problem(Constraints(planar, []), Trajectory(2, 40, 96.0), samples)
    assert_same(problem, candidates(problem, 8))


@settings(max_examples=20, deadline=None)
@given(
    joints=st.integers(1, 8),
    seed=st.integers(0, 10_000),
    regions=st.sampled_from(REGIONS),
    samples=st.sampled_from([9, 60, 64, 65, 150]),
    limit=st.sampled_from([np.inf, 30.0, 300.0]),
    torque=st.booleans(),
    names=st.sets(st.sampled_from(["acceleration", "jerk"])),
    strongest=st.sampled_from([None, 1, 5, 99]),
)
def test_compiled_evaluation_agrees_on_random_arms(
    joints, seed, regions, samples, limit, torque, names, strongest
):
    limits = np.full(joints, limit)
    limits[::2] = 150.0
    arm = limited(replace(random_chain(joints, seed)[0], torque_limit=limits), sorted(names), share=0.2)
    arm = arm if seed % 2 else driven(arm, seed)
    home = 0.3 * (arm.position_lower + arm.position_upper)
    trajectory = Trajectory(joints, 3, 7.0, home.tolist())
    problem = Problem(constrained(arm, regions, torque), trajectory, samples, strongest)
    # Parameters of which some can hardly be told apart: in an orthonormal basis nobody's digits are right.
    assume(np.linalg.cond(problem.body.base.subspace) < 1e5)
    assert_same(problem, candidates(problem, 4, seed))


def test_an_arm_at_rest_has_a_hopeless_fitness(lwr_problem):
    evaluation, still = evaluator(lwr_problem), np.zeros((1, *lwr_problem.trajectory.shape))
    np.testing.assert_allclose(evaluation(still), by_definition(lwr_problem, still), atol=1e-9)
    assert evaluation(still)[0, 0] == pytest.approx(np.log(HOPELESS))


def test_rest_without_gravity_has_infinite_cost(planar):
    """Without gravity: all eigenvalues of its Gram matrix are equal, which is not the best ratio of them."""
    arm = replace(planar, gravity=0 * planar.gravity)
    problem, gradient = Problem(Constraints(arm), Trajectory(2, 3, 8.0)), np.ones((2, 6))
    value, cost = Objective(problem, Goal())(np.zeros((2, 6)), gradient)
    assert value == math.inf and cost == 0 and (gradient == 0).all()
