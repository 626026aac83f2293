"""Exact physics that gradients pass through: finite differences, sums of Gram matrices, true excitation."""

import math
from dataclasses import replace

import pytest
import torch

from sidegan.design import objectives, physics
from sidegan.design.excitation import excite
from sidegan.design.objectives import Term
from sidegan.design.penalty import Penalty
from sidegan.design.physics import SetInformation
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory

from .conftest import assert_slopes, by_autograd

OBJECTIVES = objectives.OBJECTIVES


@pytest.fixture(scope="module")
def arm_problem(lwr_problem):
    return replace(lwr_problem, trajectory=Trajectory(7, 4, 8.0), samples=24)


def test_the_spectrum_is_that_of_the_excitation_and_its_ends_are_its_ends(arm_problem, random):
    c, near = arm_problem.start(4, random), {"rtol": 1e-6, "atol": 1e-9}
    exact = excite(arm_problem.body, arm_problem.trajectory, c, arm_problem.samples)
    one, two = SetInformation(arm_problem), SetInformation(arm_problem, 2)
    torch.testing.assert_close(physics.spectrum(one, c), exact.spectrum, **near)
    whole = physics.spectrum(two, c)
    torch.testing.assert_close(
        physics.spectrum(two, c, ends=True), torch.cat([whole[:, :3], whole[:, -2:]], 1), **near
    )


def test_the_spectrum_of_a_set_is_that_of_the_sum(planar_problem, random):
    c, body = planar_problem.start(6, random), planar_problem.body
    grams = gram(body, planar_problem.trajectory, c, planar_problem.samples).unflatten(0, (2, 3)).sum(1)
    expected = torch.linalg.eigvalsh(body.base.subspace.T @ grams @ body.base.subspace)
    found = physics.spectrum(SetInformation(planar_problem, 3), c)
    torch.testing.assert_close(found, expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("together", [1, 2])
@pytest.mark.parametrize("noise", [None, (9.0, 8.0, 5.0, 4.0, 2.0, 1.0, 0.5)])
def test_gradients_of_objectives_agree_with_finite_differences(
    arm_problem, random, objective, together, noise
):
    term = Term(objective, 1.0, together, noise)
    c = arm_problem.start(4, random, 0.9)
    assert_slopes(by_autograd(lambda x: term(arm_problem, x)), c, random, rtol=1e-4, atol=1e-6)


def test_the_gradient_of_the_violation_agrees_with_finite_differences(arm_problem, random):
    def squares(x):
        return physics.violation(arm_problem, x, Penalty(3.0)).square().sum()

    c = arm_problem.start(4, random, 1.6)
    assert assert_slopes(by_autograd(squares), c, random, rtol=1e-4, atol=1e-6) > 1e-3


def test_objectives_are_what_their_names_say(planar_problem, random):
    """Smooth extremes are outside of the true ones, by at most log(number) / 6 each."""
    c = planar_problem.start(6, random)
    exact = excite(planar_problem.body, planar_problem.trajectory, c, planar_problem.samples)
    spectrum = physics.spectrum(SetInformation(planar_problem), c)
    torch.testing.assert_close(objectives.d_optimal(spectrum), -spectrum.log().mean(1))
    mean = float(exact.eigenvalue_fitness.log().mean())
    assert -1e-9 <= float(Term("log_condition")(planar_problem, c)) - mean <= math.log(6) / 6


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("together, whole", [(1, 8), (3, 6), (5, 5)])
def test_a_set_that_a_batch_does_not_fill_is_left_out(planar_problem, random, objective, together, whole):
    term, c = Term(objective, together=together), planar_problem.start(8, random)
    value = float(term(planar_problem, c))
    assert value == pytest.approx(float(term(planar_problem, c[:whole])), rel=1e-12)
    parts = [float(term(planar_problem, part)) for part in c[:whole].split(together)]
    assert value == pytest.approx(sum(parts) / len(parts), rel=1e-9)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_single_precision_and_rest_have_finite_values_and_slopes(planar_problem, random, objective):
    for c in (planar_problem.start(4, random).float(), torch.zeros(2, *planar_problem.trajectory.shape)):
        value, slope = by_autograd(lambda x: Term(objective)(planar_problem, x))(c)
        assert slope.dtype == torch.float32 and torch.isfinite(value) and torch.isfinite(slope).all()
