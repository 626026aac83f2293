import math
from dataclasses import replace

import pytest
import torch

from sidegan.design.excitation import excite
from sidegan.design.objective import smooth_condition, value_and_gradient
from sidegan.design.objectives import log_condition
from sidegan.design.penalty import Penalty
from sidegan.design.problem import HOPELESS, Problem
from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from tests.chains import random_chain


@pytest.mark.parametrize("diagonal", [False, True])
@pytest.mark.parametrize("reach", [0.5, 1.4])
def test_the_gradient_agrees_with_finite_differences(planar_problem, random, diagonal, reach):
    problem = replace(planar_problem, diagonal=diagonal)
    c = problem.start(4, random, reach)
    direction = torch.randn(c.shape, generator=random, dtype=torch.float64)
    step = 1e-6
    penalty = Penalty(30.0)
    up, _ = value_and_gradient(problem, c + step * direction, penalty)
    down, _ = value_and_gradient(problem, c - step * direction, penalty)
    _, gradient = value_and_gradient(problem, c, penalty)
    slope = (gradient * direction).sum((1, 2, 3))
    torch.testing.assert_close((up - down) / (2 * step), slope, rtol=1e-4, atol=1e-5)


def test_the_gradient_of_the_lwr_agrees_with_finite_differences(lwr_problem, random):
    c = lwr_problem.start(2, random, 0.9)
    direction = torch.randn(c.shape, generator=random, dtype=torch.float64)
    penalty = Penalty(300.0)
    up, _ = value_and_gradient(lwr_problem, c + 1e-6 * direction, penalty)
    down, _ = value_and_gradient(lwr_problem, c - 1e-6 * direction, penalty)
    slope = (value_and_gradient(lwr_problem, c, penalty)[1] * direction).sum((1, 2, 3))
    torch.testing.assert_close((up - down) / 2e-6, slope, rtol=2e-3, atol=1e-3)


def test_without_violation_the_value_is_a_smooth_log_condition_number(planar_problem, random):
    c = planar_problem.start(5, random, 0.3)
    value, _ = value_and_gradient(planar_problem, c, Penalty(0.0))
    exact = excite(planar_problem.body, planar_problem.trajectory, c, planar_problem.samples)
    log_condition = exact.eigenvalue_fitness.log()
    # The smooth extremes lie outside the true ones, by at most log(number) / sharpness each.
    assert (value >= log_condition - 1e-9).all()
    assert (value <= log_condition + 1.0).all()


@pytest.mark.parametrize("count", [1, 3, 4, 9])
def test_the_slopes_of_the_smooth_condition_number_agree_with_finite_differences(random, count):
    values = (1 + torch.rand(5, count, generator=random, dtype=torch.float64)).cumsum(1)
    assert torch.autograd.gradcheck(log_condition, values.requires_grad_(True))
    value, slopes = smooth_condition(values.detach())
    assert (value >= (values[:, -1] / values[:, 0]).log() - 1e-12).all()
    torch.testing.assert_close((values * slopes).sum(1), torch.zeros(5).double())  # units do not matter


def test_three_values_below_and_two_above_are_smoothed():
    """Equal extremes are log(number) / 6 outside of the true ones, whatever lies between."""
    values = torch.tensor(
        [[0.5, 0.5, 0.5, 3.0, 8.0, 8.0], [0.5, 400, 500, 600, 700, 1e6]], dtype=torch.float64
    )
    value, _ = smooth_condition(values)
    assert float(value[0]) == pytest.approx(math.log(16) + (math.log(3) + math.log(2)) / 6, rel=1e-12)
    assert float(value[1]) == pytest.approx(math.log(2e6), rel=1e-9)


def test_what_is_not_excited_counts_as_hopeless():
    value, slopes = smooth_condition(torch.tensor([[0.0, 1.0, 1.0, 1.0, 2.0], [0.0] * 5]).double())
    assert value[0] == pytest.approx(math.log(2 * HOPELESS / 2), abs=0.2) and value.isfinite().all()
    assert value[1] == pytest.approx(math.log(HOPELESS)) and (slopes[1] == 0).all()  # nothing is told at all
    assert slopes[0, 0] == pytest.approx(-HOPELESS / 2) and slopes.isfinite().all()


@pytest.mark.parametrize("diagonal", [False, True])
def test_rest_that_feels_no_torque_is_the_worst_there_is(planar, diagonal):
    """Without gravity: all elements of its Gram matrix are equal, which is not the best ratio of them."""
    arm = replace(planar, gravity=0 * planar.gravity)
    problem = Problem(Constraints(arm), Trajectory(2, 3, 8.0), diagonal=diagonal)
    value, gradient = value_and_gradient(problem, torch.zeros(2, 2, 3, 2).double(), Penalty(0.0))
    assert (value == pytest.approx(math.log(HOPELESS))) and (gradient == 0).all()


def test_a_direction_that_is_not_excited_is_as_bad_as_hopeless_and_no_worse():
    value, _ = smooth_condition(torch.tensor([[0.0, 5.0, 5.0, 5.0, 7.0]]).double())
    assert float(value[0]) == pytest.approx(math.log(HOPELESS), abs=(math.log(1) + math.log(2)) / 6)


@pytest.mark.parametrize("harmonics", [1, 2, 6, 9])
def test_a_sample_more_than_two_for_each_harmonic_is_enough(planar_problem, harmonics):
    trajectory = replace(planar_problem.trajectory, harmonics=harmonics)
    assert replace(planar_problem, trajectory=trajectory, samples=2 * harmonics + 1).samples
    with pytest.raises(ShapeError, match=f"cannot see {harmonics} harmonics"):
        replace(planar_problem, trajectory=trajectory, samples=2 * harmonics)


def test_a_violation_costs(planar_problem, random):
    c = planar_problem.start(3, random, 2.0)
    free, _ = value_and_gradient(planar_problem, c, Penalty(0.0))
    penalised, _ = value_and_gradient(planar_problem, c, Penalty(100.0))
    assert (penalised > free).all()


def test_a_batch_is_the_same_as_one_by_one(planar_problem, random):
    c = planar_problem.start(3, random)
    values, gradients = value_and_gradient(planar_problem, c, Penalty(30.0))
    for k in range(3):
        value, gradient = value_and_gradient(planar_problem, c[k : k + 1], Penalty(30.0))
        torch.testing.assert_close(value[0], values[k])
        torch.testing.assert_close(gradient[0], gradients[k])


def assert_plain_code_agrees(problem, c, penalty, monkeypatch):
    compiled = value_and_gradient(problem, c, penalty)
    monkeypatch.setenv("SIDEGAN_KERNELS", "torch")
    plain = value_and_gradient(problem, c, penalty)
    torch.testing.assert_close(compiled[0], plain[0], rtol=1e-9, atol=1e-9)
    torch.testing.assert_close(compiled[1], plain[1], rtol=1e-6, atol=1e-6)


OBSTACLES = [Sphere((0.4, 0.2, 0.5), 0.2), Convex.between((-0.5, -0.4, 0.2), (-0.3, -0.2, 0.9), 0.1)]


@pytest.mark.parametrize(
    "regions",
    [
        [Plane((0, 0, 1), 0.1)],
        [Plane((0, 0.6, 0.8), -0.2)],
        OBSTACLES,
        [],
        [Box((0.3, -0.2, 0.3), (0.6, 0.3, 0.6))],
        [Plane((0, 0, 1), 0.1), Box((-0.6, 0.2, 0.2), (-0.2, 0.5, 1.2)), Plane((1, 0, 0), -0.7)],
        [*OBSTACLES, Plane((0, 0, 1), 0.1), Box((-0.6, 0.2, 0.2), (-0.2, 0.5, 1.2))],
    ],
)
def test_the_compiled_penalty_is_that_of_the_plain_code(arm, random, monkeypatch, regions):
    pytest.importorskip("numba")
    problem = Problem(Constraints(arm, regions), Trajectory(7), 40)
    c = problem.start(6, random, 1.3)
    assert_plain_code_agrees(problem, c, Penalty(300.0, distance=1.0), monkeypatch)


@pytest.mark.parametrize("joints", [3, 6])
def test_the_compiled_penalty_knows_sliding_joints(joints, random, monkeypatch):
    pytest.importorskip("numba")
    constraints = Constraints(random_chain(joints, 0)[0], [Plane((0, 0, 1), -0.3)])
    problem = Problem(constraints, Trajectory(joints, 2, 8.0, [0.0] * joints), 20)
    c = problem.start(4, random, 1.0)
    assert_plain_code_agrees(problem, c, Penalty(10.0, distance=2.0), monkeypatch)


def test_the_gradient_of_distances_from_boxes_is_exact(planar, random):
    problem = Problem(Constraints(planar, [Box((0.4, -1, 0), (1, 1, 1))]), Trajectory(2, 3, 8.0), 24)
    c = problem.start(3, random, 1.0)
    direction = torch.randn(c.shape, generator=random, dtype=torch.float64)
    up, down = (value_and_gradient(problem, c + s * direction, Penalty(30.0))[0] for s in (1e-6, -1e-6))
    slope = (value_and_gradient(problem, c, Penalty(30.0))[1] * direction).sum((1, 2, 3))
    torch.testing.assert_close((up - down) / 2e-6, slope, rtol=1e-4, atol=1e-4)
