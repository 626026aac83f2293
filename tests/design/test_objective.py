"""The penalised condition number and its gradient: finite differences, closed forms, definitions."""

import math
from dataclasses import replace

import pytest
import torch

from sidegan.design.excitation import excitation_of, excite
from sidegan.design.objective import value_and_gradient
from sidegan.design.objectives import log_condition
from sidegan.design.penalty import Penalty
from sidegan.design.physics import smooth_condition
from sidegan.design.problem import HOPELESS, Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere

from .conftest import assert_slopes, states_of

DESK, BESIDE = Plane((0, 0, 1), 0.1), Box((-0.6, 0.2, 0.2), (-0.2, 0.5, 1.2))
OBSTACLES = (Sphere((0.4, 0.2, 0.5), 0.2), Convex.between((-0.5, -0.4, 0.2), (-0.3, -0.2, 0.9), 0.1))
REGIONS = {
    "none": (),
    "desk": (DESK,),
    "tilted": (Plane((0, 0.6, 0.8), -0.2),),
    "box": (Box((0.3, -0.2, 0.3), (0.6, 0.3, 0.6)),),
    "walls": (DESK, BESIDE, Plane((1, 0, 0), -0.7)),
    "all": (*OBSTACLES, DESK, BESIDE),
}


@pytest.mark.parametrize("diagonal", [False, True])
@pytest.mark.parametrize("reach", [0.5, 1.4])
@pytest.mark.parametrize("region", [DESK, Box((0.4, -1, 0), (1, 1, 1))], ids=["desk", "box"])
def test_the_gradient_agrees_with_finite_differences(planar, random, diagonal, reach, region):
    problem = Problem(Constraints(planar, [region]), Trajectory(2, 3, 8.0), 24, diagonal)
    c = problem.start(4, random, reach)
    assert_slopes(lambda x: value_and_gradient(problem, x, Penalty(30.0)), c, random, rtol=1e-4, atol=1e-5)


def test_the_value_is_a_smooth_log_condition_number_and_what_violations_cost(planar_problem, random):
    c = planar_problem.start(5, random, 0.3)
    value, _ = value_and_gradient(planar_problem, c, Penalty(0.0))
    exact = excite(planar_problem.body, planar_problem.trajectory, c, planar_problem.samples)
    excess = value - exact.eigenvalue_fitness.log()
    # The smooth extremes lie outside the true ones, by at most log(number) / sharpness each.
    assert (excess >= -1e-9).all() and (excess <= 1.0).all()
    c = planar_problem.start(3, random, 2.0)
    free, penalised = (value_and_gradient(planar_problem, c, Penalty(weight))[0] for weight in (0.0, 100.0))
    assert (penalised > free).all()


@pytest.mark.parametrize("count", [1, 3, 4, 9])
def test_the_slopes_of_the_smooth_condition_number_agree_with_finite_differences(random, count):
    values = (1 + torch.rand(5, count, generator=random, dtype=torch.float64)).cumsum(1)
    assert torch.autograd.gradcheck(log_condition, values.requires_grad_(True))
    value, slopes = smooth_condition(values.detach())
    assert (value >= (values[:, -1] / values[:, 0]).log() - 1e-12).all()
    torch.testing.assert_close((values * slopes).sum(1), torch.zeros(5).double())  # units do not matter


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        # Equal extremes are log(number) / 6 outside of the true ones, whatever lies between.
        ([0.5, 0.5, 0.5, 3.0, 8.0, 8.0], math.log(16) + (math.log(3) + math.log(2)) / 6),
        ([0.5, 400, 500, 600, 700, 1e6], math.log(2e6)),
        # What is not excited is as bad as hopeless and no worse; where nothing is told at all, as bad.
        ([0.0, 5.0, 5.0, 5.0, 7.0], math.log(HOPELESS) + math.log(1 + (5 / 7) ** 6) / 6),
        ([0.0] * 5, math.log(HOPELESS)),
    ],
)
def test_the_smooth_condition_number_by_hand(values, expected):
    value, slopes = smooth_condition(torch.tensor([values]).double())
    assert float(value) == pytest.approx(expected, rel=1e-9) and slopes.isfinite().all()
    if not any(values):
        assert (slopes == 0).all()
    elif not values[0]:
        assert float(slopes[0, 0]) == pytest.approx(-HOPELESS / values[-1])


@pytest.mark.parametrize("diagonal", [False, True])
def test_rest_that_feels_no_torque_is_the_worst_there_is(planar, diagonal):
    """Without gravity: all elements of its Gram matrix are equal, which is not the best ratio of them."""
    arm = replace(planar, gravity=0 * planar.gravity)
    problem = Problem(Constraints(arm), Trajectory(2, 3, 8.0), diagonal=diagonal)
    value, gradient = value_and_gradient(problem, torch.zeros(2, 2, 3, 2).double(), Penalty(0.0))
    assert (value == pytest.approx(math.log(HOPELESS))) and (gradient == 0).all()


def test_a_batch_is_the_same_as_one_by_one(planar_problem, random):
    c = planar_problem.start(3, random)
    together = value_and_gradient(planar_problem, c, Penalty(30.0))
    alone = zip(*(value_and_gradient(planar_problem, one[None], Penalty(30.0)) for one in c))
    for whole, parts in zip(together, alone):
        torch.testing.assert_close(torch.cat(parts), whole)


def value_of(problem, c, penalty):
    """Log fitness and what violations cost, by their definitions, (B,)."""
    arm, constraints = problem.constraints.arm, problem.constraints
    states = states_of(problem, c)
    q, dq, *_ = states
    middle, room = (
        (arm.position_upper + arm.position_lower) / 2,
        (arm.position_upper - arm.position_lower) / 2,
    )
    uses = [(q - middle).abs() / room + penalty.limits, dq.abs() / arm.velocity_limit + penalty.limits]
    uses.append(constraints.body.torque(*states[:3]).abs() / arm.torque_limit + penalty.torque)
    margins = constraints.at_rest(q.flatten(0, 1))
    distances = [margins[name] for name in ("collision", "keep_out") if name in margins]
    lack = (penalty.reach - torch.cat(distances, 1)).clamp_min(0).unflatten(0, q.shape[:2]) / 0.25
    parts = [lack, *((use - 1).clamp_min(0) for use in uses)]
    cost = penalty.weight * sum(part.square().sum((1, 2)) for part in parts) / problem.samples
    return smooth_condition(excitation_of(problem.body, problem.gram(c)).spectrum)[0] + cost


def assert_defined_so(problem, c, penalty, random):
    value, _ = value_and_gradient(problem, c, penalty)
    torch.testing.assert_close(value, value_of(problem, c, penalty), rtol=1e-8, atol=1e-8)
    assert_slopes(lambda x: value_and_gradient(problem, x, penalty), c, random, rtol=2e-3, atol=1e-3)


@pytest.mark.parametrize("regions", REGIONS.values(), ids=REGIONS)
def test_the_value_is_that_of_its_definition(arm, random, regions):
    problem = Problem(Constraints(arm, regions), Trajectory(7), 40)
    assert_defined_so(problem, problem.start(6, random, 1.3), Penalty(300.0, distance=1.0), random)
