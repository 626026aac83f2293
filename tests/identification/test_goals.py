"""Goals of design: against the covariance of least squares written out, and against designs without them.

What recordings left uncertain: against the quality's information, and what is identified after.
"""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.base.arrays import flatten
from sidegan.design.objective import Objective
from sidegan.design.problem import Problem, SearchSettings
from sidegan.design.search import design_set
from sidegan.identification import FULL, estimate
from sidegan.identification.goals import (
    Parameters,
    Tool,
    TorquePrediction,
    Uncertain,
    uncertainty_of_description,
)
from sidegan.identification.model import states_within
from sidegan.identification.payload import with_load
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check
from tests.identification.recordings import GOAL, half_still, measured, multisine

NOISE, RATE = 0.3, 100.0
SEARCH = SearchSettings(evaluations=240, patience=80)
TERMS = replace(FULL, sign_width=0.03)
OBJECTIVES = ["parameters", ["forearm"], "payload", "prediction"]


@pytest.fixture(scope="module")
def problem(planar):
    return Problem(Constraints(planar), Trajectory(2, harmonics=3, period=8.0))


def aim_of(problem, objective):
    return uncertainty_of_description(problem.body, TERMS, replace(GOAL, objective=objective))


def known_and_motion(model, seed, samples=200):
    """Information of a motion [units of the parameters], (P, P), and of what is known, (P, P)."""
    y = model.regressor(*multisine(model.joints, samples, seed)).reshape(-1, model.count)
    return 0.1 * np.eye(model.count), y.T @ y


@pytest.mark.parametrize("identified", [True, False])
def test_deviations_of_a_tool_are_those_of_the_full_least_squares_problem(model, identified):
    """Least squares on runs without and with it, the arm's parameters unknown in both."""
    known, motion = known_and_motion(model, 3)
    tool = Tool(model, np.ones(model.count), identified)
    whole = np.zeros((model.count + 10, model.count + 10))
    whole[: model.count, : model.count] = known
    for carried in (True,) if identified else (False, True):
        rows = with_load(model, carried).regressor(*multisine(model.joints, 200, 3)).reshape(-1, len(whole))
        whole += rows.T @ rows
    typical = np.array([1, *[0.1] * 3, *[0.01] * 6])
    whole[model.count :, model.count :] += np.diag(1 / (10 * typical) ** 2)
    covariance = np.linalg.inv(whole)[model.count :, model.count :]
    deviations = np.sqrt(covariance.diagonal())
    np.testing.assert_allclose(tool.deviations(known, motion), deviations, rtol=1e-6, atol=0)
    assert tool.names[0] == "tool m" and len(tool.names) == 10
    assert "no parameter of a tool" in tool.summary(0.9 * deviations, deviations)


def test_a_goal_on_links_counts_their_parameters_only(arm, model):
    known, motion = known_and_motion(model, 4)
    unit = np.linspace(1, 2, model.count)
    goal = Parameters(model, unit, ["link_3", "link_7"])
    ours = [k for k, name in enumerate(model.names) if name[-1] in "37"]
    assert goal.names == tuple(model.names[k] for k in ours) and "fv3" in goal.names and "Izz7" in goal.names
    assert "deviations of the parameters of link_3, link_7 fall to 0.46% " in goal.summary(0.0046, 1.0)
    covariance = np.linalg.inv(known + motion)[ours][:, ours]
    deviations = np.sqrt(covariance.diagonal()) * unit[ours]
    np.testing.assert_allclose(goal.deviations(known, motion), deviations, rtol=1e-9, atol=0)
    every = [Parameters(model, unit, links).deviations(known, motion) for links in (arm.link_names, None)]
    np.testing.assert_allclose(*every)


def test_predicted_torques_err_as_the_covariance_says(arm, model):
    known, motion = known_and_motion(model, 5)
    usual = np.linspace(5, 50, arm.joints)
    goal = TorquePrediction(model, np.ones(model.count), usual)
    q, dq, ddq = states_within(arm, 400, seed=1)
    y = model.regressor(q, 0.5 * dq, 0.5 * ddq)
    variance = np.einsum("sjp,pq,sjq->sj", y, np.linalg.inv(known + motion), y).mean(0) / usual**2
    np.testing.assert_allclose(goal.deviations(known, motion), np.sqrt(variance), rtol=1e-6, atol=0)


def value(problem, aim, c):
    """The goal of the next trajectory, at one, (J, H, 2)."""
    x = flatten(c, 1)
    return Objective(problem, aim.next())(x, np.zeros_like(x))[0]


def drawn(problem):
    """Random trajectories that are valid."""
    c = problem.start(200, np.random.default_rng(2), reach=0.8)
    c = c[check(problem.constraints, problem.trajectory, c).valid]
    assert len(c) > 20
    return c


@pytest.mark.parametrize("objective", OBJECTIVES, ids=str)
def test_the_design_goal_follows_the_predicted_deviations(problem, objective):
    """Beside a trajectory of the set: it falls as they do, as far as it is their mean."""
    problem = replace(problem, samples=160)
    aim, (first, *c) = aim_of(problem, objective), problem.start(13, np.random.default_rng(0), reach=0.5)
    aim.take(problem.trajectory, first)
    values, spread = [], []
    for candidate in c:
        values.append(value(problem, aim, candidate))
        after = aim_of(problem, objective)
        after.take(problem.trajectory, first)
        after.take(problem.trajectory, candidate)
        spread.append(after.deviations)
    if objective == "prediction":
        expected = np.log(np.square(spread).mean(1))
        np.testing.assert_allclose(np.diff(values), np.diff(expected), rtol=1e-6)
    else:  # a volume, in which deviations that belong together count less
        assert np.corrcoef(values, np.log(spread).mean(1))[0, 1] > 0.8


def test_a_follow_up_design_reaches_the_predicted_deviations(planar, problem):
    model, before, data = half_still(planar, NOISE)
    aim, rest = (Uncertain(model, before.covariance, before.certainty, RATE) for _ in range(2))
    c = design_set(problem, aim, 1, SEARCH, seed=0)
    assert check(problem.constraints, problem.trajectory, c).valid.all()
    assert value(problem, rest, c[0]) < min(value(problem, rest, x) for x in drawn(problem))
    assert 0 < aim.remaining < 0.6
    assert (aim.deviations < aim.before).all()
    states = [x[0] for x in problem.trajectory.roll_out(c, problem.trajectory.times(RATE))[1:]]
    after = estimate("weighted", model, [data, measured(model, states, NOISE, 9)])
    np.testing.assert_allclose(aim.before, before.deviation, rtol=1e-6, atol=0)
    np.testing.assert_allclose(aim.deviations, after.deviation, rtol=0.3, atol=0)
    share = np.exp(np.log(after.deviation / before.deviation).mean())
    assert float(share) == pytest.approx(aim.remaining, rel=0.15)
