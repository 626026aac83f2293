import pytest
import torch

from sidegan.base.typed import build
from sidegan.design import objectives, physics
from sidegan.design.excitation import excite
from sidegan.design.objectives import Term
from sidegan.design.penalty import Penalty
from sidegan.design.physics import SetInformation
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane

OBJECTIVES = (*objectives.SPECTRAL, "diagonal_ratio")


def random(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="module")
def problem():
    return Problem(Constraints(load_robot("planar2")), Trajectory(2, 3, 8.0), 24)


@pytest.fixture(scope="module")
def arm_problem():
    constraints = Constraints(load_robot("kuka_lwr4"), [Plane((0, 0, 1), 0.1)])
    return Problem(constraints, Trajectory(7, 4, 8.0), 24)


def slopes(function, c, direction, step=1e-6):
    """Directional derivative by central differences, and by autograd."""
    with torch.no_grad():
        up, down = function(c + step * direction), function(c - step * direction)
    c = c.clone().requires_grad_(True)
    (gradient,) = torch.autograd.grad(function(c), c)
    return (up - down) / (2 * step), (gradient * direction).sum()


def test_the_spectrum_is_that_of_the_excitation(arm_problem):
    c = arm_problem.start(4, random())
    exact = excite(arm_problem.body, arm_problem.trajectory, c, arm_problem.samples)
    torch.testing.assert_close(
        physics.spectrum(SetInformation(arm_problem), c), exact.spectrum, rtol=1e-6, atol=1e-9
    )
    torch.testing.assert_close(physics.diagonal(SetInformation(arm_problem), c), exact.diagonal)


def test_the_ends_are_those_of_the_spectrum(arm_problem):
    c = arm_problem.start(4, random())
    whole = physics.spectrum(SetInformation(arm_problem, 2), c)
    expected = torch.cat([whole[:, :3], whole[:, -2:]], 1)
    torch.testing.assert_close(
        physics.spectrum(SetInformation(arm_problem, 2), c, ends=True), expected, rtol=1e-6, atol=1e-10
    )


def test_the_spectrum_of_a_set_is_that_of_the_sum(problem):
    c = problem.start(6, random())
    grams = gram(problem.body, problem.trajectory, c, problem.samples).unflatten(0, (2, 3)).sum(1)
    subspace = problem.body.base.subspace
    expected = torch.linalg.eigvalsh(subspace.T @ grams @ subspace)
    torch.testing.assert_close(
        physics.spectrum(SetInformation(problem, 3), c), expected, rtol=1e-8, atol=1e-12
    )


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("together", [1, 2])
@pytest.mark.parametrize("noise", [None, (9.0, 8.0, 5.0, 4.0, 2.0, 1.0, 0.5)])
def test_gradients_of_objectives_agree_with_finite_differences(arm_problem, objective, together, noise):
    c = arm_problem.start(4, random(3), 0.9)
    direction = torch.randn(c.shape, generator=random(4), dtype=torch.float64)
    measured, exact = slopes(lambda x: Term(objective, 1.0, together, noise)(arm_problem, x), c, direction)
    torch.testing.assert_close(exact, measured, rtol=1e-4, atol=1e-6)


def test_equal_noise_scales_the_information(problem):
    c = problem.start(3, random())
    plain, halved = (physics.spectrum(SetInformation(problem, 1, noise), c) for noise in (None, (2.0, 2.0)))
    torch.testing.assert_close(4 * halved, plain, rtol=1e-8, atol=1e-10)


def test_a_joint_without_much_noise_counts_more(problem):
    """With the first joint's torque useless, what remains is the second joint's information."""
    c = problem.start(3, random())
    y = problem.body.base_regressor(*problem.motion(c)[1:])[:, :, 1]
    expected = y.transpose(1, 2) @ y / problem.samples
    torch.testing.assert_close(SetInformation(problem, 1, (1e9, 1.0)).grams(c), expected)


def test_the_gradient_of_the_violation_agrees_with_finite_differences(arm_problem):
    c = arm_problem.start(4, random(3), 1.6)
    direction = torch.randn(c.shape, generator=random(4), dtype=torch.float64)
    measured, exact = slopes(
        lambda x: physics.violation(arm_problem, x, Penalty(3.0)).square().sum(), c, direction
    )
    assert abs(measured) > 1e-3
    torch.testing.assert_close(exact, measured, rtol=1e-4, atol=1e-6)


def test_objectives_are_what_their_names_say(problem):
    c = problem.start(5, random())
    spectrum = physics.spectrum(SetInformation(problem), c)
    logs = spectrum.log()
    torch.testing.assert_close(objectives.d_optimal(spectrum), -logs.mean(1))
    torch.testing.assert_close(objectives.a_optimal(spectrum), (1 / spectrum).mean(1).log())
    condition = (spectrum[:, -1] / spectrum[:, 0]).log()
    smooth = objectives.log_condition(spectrum)
    assert (smooth >= condition - 1e-9).all() and (smooth <= condition + 0.35).all()


def test_a_set_is_at_least_as_informative_as_its_members(problem):
    c = problem.start(8, random())
    alone, together = (physics.spectrum(SetInformation(problem, k), c) for k in (1, 8))
    assert objectives.d_optimal(together) < objectives.d_optimal(alone).min()
    assert objectives.a_optimal(together) < objectives.a_optimal(alone).min()


def test_single_precision_comes_in_and_goes_out(problem):
    c = problem.start(4, random()).float().requires_grad_(True)
    Term("log_condition")(problem, c).backward()
    assert c.grad is not None and c.grad.dtype == torch.float32 and torch.isfinite(c.grad).all()


def test_a_trajectory_at_rest_gives_finite_values_and_slopes(problem):
    for objective in OBJECTIVES:
        c = torch.zeros(2, *problem.trajectory.shape, requires_grad=True)
        value = Term(objective)(problem, c)
        (slope,) = torch.autograd.grad(value, c)
        assert torch.isfinite(value) and torch.isfinite(slope).all()


def test_what_cannot_be_weighed_is_refused(problem):
    for wrong, message in [
        ({"objective": "fame"}, "objective is 'fame', expected one of log_condition"),
        ({"together": 0}, "together is 0"),
        ({"noise": [1.0, 0.0]}, r"noise\[1\] is 0"),
    ]:
        with pytest.raises(ConfigError, match=message):
            build(Term, {"objective": "d_optimal", **wrong})
    with pytest.raises(ShapeError, match="expected 2 positive deviations"):
        SetInformation(problem, 1, (1.0,))
    with pytest.raises(ShapeError, match="batch of 5 trajectories does not fall into sets of 2"):
        physics.spectrum(SetInformation(problem, 2), problem.start(5, random()))
