import pytest
import torch

from sidegan.design.coordinates import Coordinates
from sidegan.design.polish import Polish
from sidegan.errors import ConfigError, ShapeError
from sidegan.validity import check


def test_valid_trajectories_stay_valid_and_none_becomes_worse(planar_problem, random):
    problem = planar_problem
    c = problem.start(24, random, 0.9)
    found = Polish(30).improve(problem, c)
    valid = [check(problem.constraints, problem.trajectory, x).valid for x in (c, found)]
    fitness = [problem.fitness(x) for x in (c, found)]
    assert (valid[1] | ~valid[0]).all()
    assert (fitness[1] <= fitness[0])[valid[0]].all()
    assert fitness[1].median() < 0.5 * fitness[0].median()


def test_more_steps_do_better(planar_problem, random):
    c = planar_problem.start(16, random, 0.9)
    means = [planar_problem.fitness(Polish(k).improve(planar_problem, c)).log().mean() for k in (2, 10, 60)]
    assert means[0] > means[1] > means[2]


def test_a_batch_is_the_same_as_its_parts(planar_problem, random):
    c = planar_problem.start(70, random, 0.9)
    whole = Polish(5).improve(planar_problem, c)
    torch.testing.assert_close(whole[64:], Polish(5).improve(planar_problem, c[64:]), rtol=1e-6, atol=1e-9)


def test_points_and_coefficients_go_round(planar_problem, random):
    coordinates = Coordinates.of(planar_problem)
    c = planar_problem.start(5, random)
    torch.testing.assert_close(coordinates.coefficients(coordinates.points(c)), c)


def test_what_cannot_be_polished_is_refused(planar_problem):
    with pytest.raises(ConfigError, match="one step or more, got 0"):
        Polish(0)
    with pytest.raises(ShapeError, match="coefficients are"):
        Polish(3).improve(planar_problem, torch.zeros(2, 9, 9, 2))
