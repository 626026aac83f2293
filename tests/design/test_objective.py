"""Goals, penalty and evaluation of trajectories, compiled: finite differences and their definitions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.special import logsumexp

from sidegan.design.objective import Goal, Objective, Penalty, evaluator
from sidegan.design.problem import Coordinates, Problem
from sidegan.identification.model import RIGID, Terms, TorqueModel, states_within
from sidegan.kernels import HIGHEST, HOPELESS, LOWEST, SHARPNESS
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from tests.chains import constrained, driven, random_chain
from tests.validity.critical import limited, margins_of

from .conftest import CASES

PENALTY = Penalty(300.0, 0.1, 0.1, 0.8)
REFINE = 3
TERMS = Terms(rotor_inertia=True, sign_width=0.3)


def point(problem, coordinates, seed, use=1.2):
    """A point (J, K) of which each joint uses a share of its limits."""
    return coordinates.start(problem, 1, np.random.default_rng(seed), use)[0]


def information_on(model, states, certainty=None):
    rows = np.ones(model.joints) if certainty is None else certainty
    y = (model.regressor(*states) * rows[:, None]).reshape(-1, model.count)
    return y.T @ y / len(states[0])


def goals(problem):
    """Goals of every kind, by name."""
    body, joints = problem.body, problem.body.joints
    rigid = TorqueModel(body, RIGID)
    model = TorqueModel(body, TERMS)
    noisy = {"certainty": np.linspace(2.0, 0.5, joints), "rate": 100.0}
    whole = {"prior": information_on(model, states_within(body.arm, 200, seed=4)), "model": model, **noisy}
    prior = information_on(rigid, states_within(body.arm, 200, seed=4))
    targets = np.linalg.cholesky(information_on(model, states_within(body.arm, 200, seed=3))).T
    last = [name[-1] == str(joints) for name in model.names]
    tool = model.mapping[:, 10 * (joints - 1) : 10 * joints].T
    tool_prior = np.eye(10) / 25
    return {
        "condition": Goal(),
        "condition by noise": Goal(**noisy),
        "condition of a set": Goal(prior=16 * prior),
        "volume": Goal("volume", prior, targets=np.eye(rigid.count), **noisy),
        "variance": Goal("variance", prior, targets=np.eye(rigid.count)[:2]),
        "volume with friction": Goal("volume", targets=np.eye(model.count), **whole),
        "volume of a link and its joint": Goal("volume", targets=np.eye(model.count)[last], **whole),
        "variance on tasks": Goal("variance", targets=targets, **whole),
        "tool": Goal("tool", targets=tool, tool_prior=tool_prior, **whole),
        "tool and without it": Goal("tool", targets=tool, tool_prior=tool_prior, runs=2, **whole),
    }


def motion_of(problem, coordinates, x, count, orders):
    """Derivatives from none on at so many time points, (count, J) each."""
    family, c = problem.trajectory, coordinates.coefficients(x[None])
    return [family.derivative(c, family.grid(count), order)[0] for order in range(orders)]


def log_condition(x):
    """Logarithm of the smooth largest over the smooth smallest of values, ascending, (B, p) → (B,)."""
    positive = x[:, -1:] > 0
    values = np.where(positive, np.maximum(x, x[:, -1:] / HOPELESS), 1.0)
    low, high = np.log(values[:, :LOWEST]), np.log(values[:, -HIGHEST:])
    ends = logsumexp(-SHARPNESS * low, 1) + logsumexp(SHARPNESS * high, 1)
    return np.where(positive[:, 0], ends / SHARPNESS, math.log(HOPELESS))


def log_det(x):
    return np.linalg.slogdet(x).logabsdet


def goal_of(problem, goal, states):
    """The goal by its definition, from the regressor of all parameters."""
    body, period = problem.body, problem.trajectory.period
    model = goal.model or TorqueModel(body, RIGID)
    told = information_on(model, states, goal.certainty)
    whole = goal.rate * period * told
    prior = np.zeros_like(whole) if goal.prior is None else goal.prior
    if goal.kind == "condition":
        inner = body.base.subspace.T @ (prior + whole) @ body.base.subspace
        return log_condition(np.linalg.eigvalsh(inner)[None]).item()
    if goal.kind != "tool":
        covariance = goal.targets @ np.linalg.solve(prior + whole, goal.targets.T)
        return np.log(covariance.trace()) if goal.kind == "variance" else log_det(covariance)
    beside = np.concatenate([np.eye(model.count), goal.targets])  # arm and tool in one run with it
    both = beside @ whole @ beside.T
    both[: model.count, : model.count] += prior + (goal.runs - 1) * whole
    both[model.count :, model.count :] += goal.tool_prior
    return log_det(np.linalg.inv(both)[model.count :, model.count :])


def cost_of(problem, coordinates, x):
    """The penalty by its definition."""
    constraints, p = problem.constraints, PENALTY
    arm, limits = constraints.arm, [problem.constraints.arm.velocity_limit, *constraints.higher_rows]
    orders = 4 if constraints.higher else 2
    q, *rest = motion_of(problem, coordinates, x, problem.samples * REFINE, orders)
    lower, upper = arm.position_lower, arm.position_upper
    middle, room = (upper + lower) / 2, (upper - lower) / 2
    uses = [np.abs(q - middle) / room, *(np.abs(x) / limit for x, limit in zip(rest, limits))]
    parts = [p.weight * np.square(np.maximum(use + p.limits - 1, 0)) for use in uses]
    if constraints.torque:
        torque = np.abs(problem.body.torque(*motion_of(problem, coordinates, x, problem.samples, 3)))
        parts.append(p.weight * np.square(np.maximum(torque / arm.torque_limit + p.torque - 1, 0)))
    margins = constraints.at_rest(q)
    distances = [margins[name] for name in ("collision", "keep_out") if name in margins]
    short = np.maximum(p.distance - np.concatenate(distances, 1) / 0.25, 0)  # of shares of 0.25 m
    parts.append(p.weight * np.square(short))
    cost = sum(float(part.sum(1).mean()) for part in parts)
    if problem.box is not None:
        use = np.abs(coordinates.coefficients(x[None])) / problem.box
        cost += p.weight * np.square(np.maximum(use + p.limits - 1, 0)).sum() / (problem.samples * REFINE)
    return cost


def assert_defined_so(problem, goal, seed, use=1.2):
    """Value by its definition, slopes by central differences along three directions; the penalty."""
    coordinates = Coordinates.of(problem)
    x = point(problem, coordinates, seed, use)
    objective = Objective(problem, goal, PENALTY, REFINE, coordinates.matrix)
    gradient, ignored, random = np.zeros_like(x), np.zeros_like(x), np.random.default_rng(1)
    value, cost = objective(x, gradient)
    states = motion_of(problem, coordinates, x, problem.samples, 3)
    assert cost == pytest.approx(cost_of(problem, coordinates, x), rel=1e-8, abs=1e-8)
    assert value == pytest.approx(goal_of(problem, goal, states), rel=1e-6, abs=1e-6)
    near = {"rel": 1e-4, "abs": 1e-4 * max(1.0, float(np.abs(gradient).max()))}
    for direction in random.standard_normal((3, *x.shape)):
        up, down = (sum(objective(x + s * direction, ignored)) for s in (1e-6, -1e-6))
        assert (up - down) / 2e-6 == pytest.approx(float((gradient * direction).sum()), **near)
    return cost


@pytest.mark.parametrize("case", [case for case in CASES if "pieces" not in case])
def test_value_and_gradient_agree_with_definition_and_finite_differences(arm, case):
    problem = Problem(*CASES[case](arm), samples=40)
    for goal in goals(problem).values() if case == "all" else [Goal()]:
        assert assert_defined_so(problem, goal, seed=2) > 0  # something is violated


def test_a_box_around_the_coefficients(arm):
    problem = Problem(*CASES["desk"](arm), samples=40)
    boxed = replace(problem, box=0.02)
    c = np.full((1, *problem.trajectory.shape), 0.11)
    assert (problem.limit_use(c) < 5).all() and boxed.limit_use(c) == pytest.approx(0.11 / 0.02)
    assert assert_defined_so(boxed, Goal(), seed=2) > 0  # coefficients are beyond the box


def test_an_arm_of_two_joints_and_few_parameters(planar):
    regions = Plane((0, 0, 1), 0.1), Box((0.4, -1, 0), (1, 1, 1))
    problem = Problem(Constraints(planar, regions), Trajectory(2, 3, 8.0), 40)
    for goal in goals(problem).values():
        assert_defined_so(problem, goal, seed=4, use=0.8)


@pytest.mark.parametrize("chain", [(3, 0), (4, 2)], ids=["five parameters", "many parameters"])
def test_prismatic_joints(chain):
    """Nor is an arm with no more parameters than the condition number looks at eigenvalues."""
    arm, regions = random_chain(*chain)[0], (Plane((0, 0, 1), -0.3), Box((0.2, -0.4, -0.5), (0.6, 0.1, 0.4)))
    assert arm.prismatic.any() and not arm.prismatic.all()
    problem = Problem(Constraints(arm, regions), Trajectory(arm.joints, 3, 8.0), 40)
    assert_defined_so(problem, Goal(), seed=6)


DESK = Plane((0.0, 0.0, 1.0), 0.1)
ROUND = (Sphere((0.5, 0.2, 0.3), 0.25), Convex.between((-0.5, -0.5, 0.0), (-0.4, -0.3, 0.6), 0.1))
REGIONS = ((), (DESK,), (DESK, Box((0.3, -0.4, -0.6), (0.8, 0.3, 0.4))), ROUND)


def candidates(problem, count, seed=0):
    """Coefficients, (count, J, H, 2), of which some hold each constraint and some do not."""
    random = np.random.default_rng(seed)
    speed = problem.constraints.arm.velocity_limit
    share = random.uniform(0.01, 1.0, (count, 1, 1, 1))
    return share * speed[:, None, None] * random.normal(size=(count, *problem.trajectory.shape))


def by_definition(problem, c):
    """Log fitness and violations, (B, 1 + G), from the problem's own."""
    constraints, family = problem.constraints, problem.trajectory
    margins = margins_of(constraints, family, c, family.grid(problem.samples))
    violations = [-share.min((1, 2)) for share in constraints.relative(margins, 1.0).values()]
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


@settings(max_examples=20)
@given(
    joints=st.integers(1, 8),
    seed=st.integers(0, 10_000),
    regions=st.sampled_from(REGIONS),
    samples=st.sampled_from([9, 60, 64, 65, 150, 700]),  # in blocks
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
