"""Coordinates, excitation and information: the full YᵀY and closed forms as oracles; what is refused."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sidegan.design.excitation import Excitation, condition_of, information_of, measure_excitation
from sidegan.design.fidelity import effective_rank, mean_cosine, mean_distance, nearest_distance
from sidegan.design.problem import Coordinates, Problem
from sidegan.design.selection import Selection, a_optimal, d_optimal, greedy
from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER
from sidegan.validity import Constraints
from tests.chains import random_chain
from tests.refusals import refused
from tests.validity.critical import limited

from .conftest import semidefinite, trajectories


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
    """Of its tightest limit, accelerations and jerks among them."""
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


def test_limit_use_is_relative_to_the_room_on_either_side_of_home(planar):
    high = planar.position_upper
    problem = Problem(Constraints(planar), Trajectory(2, 3, 8.0, (0.7 * high).tolist()), 24)
    c = np.random.default_rng(0).standard_normal((20, 2, 3, 2)) * 1e-3
    away = problem.trajectory.derivative(c, problem.trajectory.grid(4 * 24), 0) - 0.7 * high
    expected = np.maximum(away.max(1) / (0.3 * high), -away.min(1) / (1.7 * high))
    slow = replace(planar, velocity_limit=np.full_like(high, 1e9))
    np.testing.assert_allclose(replace(problem, constraints=Constraints(slow)).limit_use(c), expected)


@pytest.mark.parametrize("joints", [0, 1, 2, 4])
def test_spectrum_trace_and_diagonal_are_those_of_the_full_regressor(joints, arm):
    arm = random_chain(joints, 0)[0] if joints else arm
    body, (trajectory, c) = RigidBody(arm), trajectories(arm.joints)
    excitation = measure_excitation(body, trajectory, c)
    y = body.regressor(*trajectory.roll_out(c, trajectory.grid(80))[1:]).reshape(len(c), -1, 10 * arm.joints)
    gram, p = y.mT @ y / 80, body.parameters_count
    eigenvalues, diagonal = np.linalg.eigvalsh(gram), np.linalg.diagonal(gram)
    noise = 1e-13 * eigenvalues[:, -1:]
    assert (np.abs(eigenvalues[:, :-p]) <= noise).all()
    assert (np.abs(excitation.spectrum - eigenvalues[:, -p:]) <= noise + 1e-9 * eigenvalues[:, -p:]).all()
    np.testing.assert_allclose(excitation.spectrum.sum(1), diagonal.sum(1))
    np.testing.assert_allclose(excitation.diagonal, diagonal[:, body.base.columns])
    for noise in (None, np.linspace(0.5, 2.5, arm.joints).tolist()):
        rows = y if noise is None else y / np.tile(noise, 80)[:, None]
        expected = np.linalg.eigvalsh(rows.mT @ rows / 80)[:, -p:]
        found = np.linalg.eigvalsh(information_of(body, trajectory, c, noise=noise))
        assert (np.abs(found - expected) <= 1e-9 * expected + 1e-12 * expected[:, -1:]).all()


def test_the_condition_number_is_numpys_or_infinite_if_unexcited():
    for matrix in semidefinite(0, 5):
        assert condition_of(matrix) == pytest.approx(float(np.linalg.cond(matrix)), rel=1e-6)
    for matrix in (np.ones((3, 3)), np.zeros((3, 3))):
        assert condition_of(matrix) == math.inf


def test_fitness_is_the_ratio_of_largest_to_smallest():
    spectrum = np.array([[2.0, 3.0, 8.0], [1e-9, 1.0, 1.0]])
    diagonal = np.array([[5.0, 1.0, 2.0], [7.0, 3.5, 7.0]])
    excitation = Excitation(spectrum, diagonal)
    np.testing.assert_allclose(excitation.eigenvalue_fitness, [4.0, 1e9])
    assert excitation.diagonal_fitness.tolist() == [5.0, 2.0]
    for low in (0.0, -1e-18, 4e-16):  # an unexcited direction
        spectrum = np.array([[low, 0.5, 1.0]])
        assert Excitation(spectrum, spectrum).eigenvalue_fitness.item() == math.inf


NAN, INF = math.nan, math.inf
SIX = semidefinite(0, 6)
FLAT = np.stack([np.diag([1.0, 2.0, 0.0, 1.0])] * 6)


def spoilt(shape, where, value):
    x = np.ones(shape)
    x[where] = value
    return x


REFUSALS = [  # what the message names, and the call
    ("not finite", partial(condition_of, np.full((2, 2), NAN))),
    *((f"{count} of 6", partial(d_optimal, SIX, count)) for count in (0, -1, 7)),
    *((str(x.shape), partial(a_optimal, x, 1)) for x in (SIX[:0], SIX[0])),
    ("parameters", partial(d_optimal, FLAT, 2)),
    *(("not finite", partial(d_optimal, spoilt((5, 4, 4), 2, x), 2)) for x in (NAN, INF)),
    *((f"{count} of 3", partial(greedy, np.ones((3, 2)), count)) for count in (0, -1, 4)),
    *((str(shape), partial(greedy, np.ones(shape), 1)) for shape in [(3,), (3, 2, 2), (3, 0)]),
    *(("diagonal[2]", partial(greedy, spoilt((4, 2), (2, 1), x), 2)) for x in (NAN, INF, -1e-3)),
    ("1 of 0", partial(greedy, np.ones((0, 2)), 1)),
    *(
        ("1", partial(measure, np.zeros((1, 7))))
        for measure in (mean_distance, nearest_distance, effective_rank, mean_cosine)
    ),
]


@pytest.mark.parametrize(("about", "call"), REFUSALS)
def test_invalid_arrays_and_counts_are_refused(about, call):
    with refused(ShapeError, about):
        call()


@pytest.mark.parametrize("measure", [measure_excitation, information_of])
def test_invalid_coefficients_are_refused(planar, measure):
    body, (trajectory, c) = RigidBody(planar), trajectories(2)
    for wrong, about in ((c[0], str(c[0].shape)), (spoilt(c.shape, 3, NAN), "coefficients[3]")):
        with refused(ShapeError, about):
            measure(body, trajectory, wrong)
    with refused(ShapeError, "7", "2"):
        measure(body, *trajectories(7))


@pytest.mark.parametrize("noise", [[1.0], [1.0, 0.0], [1.0, NAN], [1.0] * 3])
def test_invalid_noise_is_refused(planar_problem, random, noise):
    c = planar_problem.start(2, random)
    with refused(ShapeError, "noise", str(noise)):
        information_of(planar_problem.body, planar_problem.trajectory, c, noise=noise)


def test_noise_is_refused_for_a_score_without_noise():
    with refused(ConfigError, "greedy", "noise"):
        Selection(noise=[3.0, 0.5])


def test_too_few_samples_are_refused(planar_problem):
    for harmonics in (1, 2, 6, 9):
        problem = partial(replace, planar_problem, trajectory=Trajectory(2, harmonics))
        assert problem(samples=2 * harmonics + 1).samples
        with refused(ShapeError, f"samples is {2 * harmonics}", f"more than {2 * harmonics}"):
            problem(samples=2 * harmonics)
