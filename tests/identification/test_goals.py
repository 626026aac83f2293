"""Goals of design: against the covariance of least squares written out, and against designs without them.

What recordings left uncertain: against trust's information, and what is identified after.
"""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.design.problem import Problem
from sidegan.design.sequence import Search, information, value_and_gradient
from sidegan.design.sequence import designed as by_search
from sidegan.designer import DesignerSettings, Situation
from sidegan.designer.compiled import Descents
from sidegan.designer.descent import Penalties
from sidegan.designer.scene import ArmNumbers
from sidegan.errors import InfeasibleError
from sidegan.identification import FULL, estimate
from sidegan.identification.designed import designed
from sidegan.identification.goals import Everything, OfLinks, Tool, Torques
from sidegan.identification.model import states_within
from sidegan.identification.payload import Loaded
from sidegan.identification.trust import certainty
from sidegan.identification.uncertain import Uncertain, unmeasured
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane, check
from tests.identification.recordings import GOAL, half_still, measured, model_of, multisine

NOISE, RATE = 0.3, 100.0
DESIGNER = DesignerSettings(40, refine=3, reserve=0.03, clearance=0.015, patience=80, rate=RATE)
SEARCH = Search(starts=4, rough=15, strict=25, samples=8, reserve=0.02)
TERMS = replace(FULL, sign_width=0.03)
WANTED = {"all": "all", "links": ["forearm"], "payload": "payload", "prediction": "prediction"}


@pytest.fixture(scope="module")
def problem(planar):
    return Problem(Constraints(planar), Trajectory(2, harmonics=3, period=8.0))


def aim_of(problem, wanted):
    return unmeasured(problem.body, TERMS, replace(GOAL, wanted=wanted))


def known_and_motion(model, seed, samples=200):
    """Information of a motion [units of the parameters], (P, P), and of what is known, (P, P)."""
    y = model.regressor(*multisine(model.joints, samples, seed)).flatten(0, 1)
    return 0.1 * torch.eye(model.count).double(), y.T @ y


@pytest.mark.parametrize("identified", [True, False])
def test_a_tool_is_told_as_by_the_whole_system_of_equations(arm, identified):
    """Least squares on runs without and with it, the arm's parameters unknown in both."""
    model = model_of(arm)
    known, motion = known_and_motion(model, 3)
    tool = Tool(model, torch.ones(model.count).double(), identified)
    whole = torch.zeros(model.count + 10, model.count + 10).double()
    whole[: model.count, : model.count] = known
    for carried in (True,) if identified else (False, True):
        rows = Loaded(model, carried).regressor(*multisine(arm.joints, 200, 3)).flatten(0, 1)
        whole += rows.T @ rows
    typical = torch.tensor([1, *[0.1] * 3, *[0.01] * 6]).double()
    whole[model.count :, model.count :] += torch.diag(1 / (10 * typical) ** 2)
    covariance = torch.linalg.inv(whole)[model.count :, model.count :]
    deviations = covariance.diagonal().sqrt()
    torch.testing.assert_close(tool.deviations(known, motion), deviations, rtol=1e-6, atol=0)
    scaled = torch.logdet(covariance / typical / typical[:, None])
    assert float(tool.value(known, motion)) == pytest.approx(float(scaled) / 10, rel=1e-6)
    assert tool.names[0] == "tool m" and len(tool.names) == 10


def test_of_links_only_their_parameters_count(arm):
    model = model_of(arm)
    known, motion = known_and_motion(model, 4)
    unit = torch.linspace(1, 2, model.count).double()
    goal = OfLinks(model, unit, ["link_3", "link_7"])
    ours = [k for k, name in enumerate(model.names) if name[-1] in "37"]
    assert goal.names == tuple(model.names[k] for k in ours) and "fv3" in goal.names and "Izz7" in goal.names
    covariance = torch.linalg.inv(known + motion)[ours][:, ours]
    deviations = covariance.diagonal().sqrt() * unit[ours]
    torch.testing.assert_close(goal.deviations(known, motion), deviations, rtol=1e-9, atol=0)
    assert float(goal.value(known, motion)) == pytest.approx(float(torch.logdet(covariance)) / len(ours))
    every = OfLinks(model, unit, arm.link_names)
    torch.testing.assert_close(every.value(known, motion), Everything(model, unit).value(known, motion))


def test_predicted_torques_err_as_the_covariance_says(arm):
    model = model_of(arm)
    known, motion = known_and_motion(model, 5)
    usual = torch.linspace(5, 50, arm.joints).double()
    goal = Torques(model, torch.ones(model.count).double(), usual)
    q, dq, ddq = states_within(arm, 400, seed=1)
    y = model.regressor(q, 0.5 * dq, 0.5 * ddq)
    variance = torch.einsum("sjp,pq,sjq->sj", y, torch.linalg.inv(known + motion), y).mean(0) / usual**2
    torch.testing.assert_close(goal.deviations(known, motion), variance.sqrt(), rtol=1e-6, atol=0)
    assert float(goal.value(known, motion)) == pytest.approx(float(variance.mean().log()), rel=1e-6)


@pytest.mark.parametrize("wanted", WANTED.values(), ids=WANTED)
def test_the_gradient_is_that_of_the_value(problem, wanted):
    aim, step = aim_of(problem, wanted), 1e-6
    c = problem.start(3, torch.Generator().manual_seed(0), reach=0.5)
    aim.take(information(problem, aim, c[2:], 40)[0])
    _, gradient = value_and_gradient(problem, aim, c[:2], 40)
    direction = torch.randn(gradient.shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    ends = [value_and_gradient(problem, aim, c[:2] + s * direction, 40)[0] for s in (-step, step)]
    slope = (ends[1] - ends[0]) / (2 * step)
    torch.testing.assert_close((gradient * direction).sum((1, 2, 3)), slope, rtol=1e-4, atol=1e-8)


def for_goal(problem, aim, count):
    return designed(problem, aim, count, DESIGNER, GOAL.evaluations, SEARCH, seed=0)


def test_what_is_designed_for_a_goal_tells_it_better_than_what_is_not(problem):
    designs = {}
    for name, wanted in WANTED.items():
        aim = aim_of(problem, wanted)
        designs[name] = for_goal(problem, aim, 1)
        assert aim.left < 1 and len(aim.deviations) == len(aim.goal.names)
    every = torch.cat([*designs.values()])
    assert check(problem.constraints, problem.trajectory, every).valid.all()
    drawn = problem.start(200, torch.Generator().manual_seed(2), reach=0.8)
    drawn = drawn[check(problem.constraints, problem.trajectory, drawn).valid]
    for k, wanted in enumerate(WANTED.values()):
        aim = aim_of(problem, wanted)
        values = aim.value(information(problem, aim, torch.cat([every, drawn]), 80))
        assert values[k] < values[len(every) :].min()
        assert values[k] <= values[: len(every)].min() + 2 * np.log(1.05)  # 5 % of the deviations


@pytest.mark.parametrize("wanted", ["all", ["forearm"], "prediction"], ids=["all", "links", "prediction"])
def test_a_designer_is_asked_for_the_goal_itself_beside_what_was_told(problem, wanted):
    """Between two trajectories both differ by as much, a goal's mean over what is wanted allowed for."""
    aim, c = aim_of(problem, wanted), problem.start(3, torch.Generator().manual_seed(0), reach=0.5)
    aim.take(information(problem, aim, c[2:], 40)[0])
    numbers = ArmNumbers(problem.constraints, problem.trajectory)
    scene, descents = numbers.scene(Situation()), Descents(numbers, DESIGNER)
    descent = descents.descent(scene, aim.asked(RATE), Penalties(0.0, 0.0, 0.0, 0.0))
    x = (c[:2].flatten(2).numpy() @ np.linalg.inv(numbers.turn).T) / scene.size
    found = [descent.evaluate(one, np.zeros_like(one))[0] for one in x]
    count = 1 if wanted == "prediction" else len(aim.goal.names)
    values = count * aim.value(information(problem, aim, c[:2], DESIGNER.samples))
    assert found[0] - found[1] == pytest.approx(float(values[0] - values[1]), rel=1e-6, abs=1e-8)


def test_a_set_is_designed_one_after_another_and_known_then(problem):
    aim = aim_of(problem, "all")
    c = for_goal(problem, aim, 3)
    assert check(problem.constraints, problem.trajectory, c).valid.all()
    again, lefts = aim_of(problem, "all"), []
    for one in c:
        again.take(information(problem, again, one[None], 80)[0])
        lefts.append(again.left)
    assert lefts[0] > lefts[1] > lefts[2] == pytest.approx(aim.left, rel=0.02)
    assert torch.equal(for_goal(problem, aim_of(problem, "all"), 3), c)


def test_where_nothing_can_be_proven_that_is_told(planar):
    behind = Trajectory(2, harmonics=3, period=6.0, home=(-1.5, 0.0))
    problem = Problem(Constraints(planar, [Plane(normal=(1, 0, 0), offset=-0.3)]), behind)
    with pytest.raises(InfeasibleError, match="at home, keep_out of"):
        for_goal(problem, aim_of(problem, "all"), 1)


@pytest.fixture(scope="module")
def poor(planar):
    return half_still(planar, NOISE)


def rest_of(poor):
    model, found, _ = poor
    return Uncertain(model, found.covariance, certainty(found), RATE)


def test_what_is_designed_for_the_rest_is_as_certain_then_as_promised(poor, problem):
    (model, before, data), aim = poor, rest_of(poor)
    c = by_search(problem, aim, 1, SEARCH, torch.Generator().manual_seed(0))
    assert check(problem.constraints, problem.trajectory, c).valid.all()
    drawn = problem.start(200, torch.Generator().manual_seed(2), reach=0.8)
    drawn = drawn[check(problem.constraints, problem.trajectory, drawn).valid]
    assert len(drawn) > 20
    values = rest_of(poor).value(information(problem, rest_of(poor), torch.cat([c, drawn]), 80))
    assert values[0] < values[1:].min()
    assert 0 < aim.left < 0.6 and rest_of(poor).left == 1
    assert (aim.deviations < aim.before).all()
    states = [x[0] for x in problem.trajectory.roll_out(c, problem.trajectory.times(RATE))[1:]]
    after = estimate("weighted", model, [data, measured(model, states, NOISE, 9)])
    change = torch.logdet(after.covariance) - torch.logdet(before.covariance)
    torch.testing.assert_close(aim.before, before.deviation, rtol=1e-6, atol=0)
    torch.testing.assert_close(aim.deviations, after.deviation, rtol=0.3, atol=0)
    assert float((change / (2 * model.count)).exp()) == pytest.approx(aim.left, rel=0.15)


def test_what_is_known_is_the_inverse_of_the_covariance_in_whatever_units(poor):
    model, random = poor[0], torch.Generator().manual_seed(0)

    def known(covariance):
        aim = Uncertain(model, covariance, torch.ones(model.joints).double(), RATE)
        return torch.from_numpy(aim.asked(RATE).prior)

    root = torch.randn(model.count, model.count, generator=random, dtype=torch.float64)
    unit = 10.0 ** torch.linspace(-3, 1, model.count, dtype=torch.float64)
    units, covariance = torch.outer(unit, unit), root @ root.T + torch.eye(model.count).double()
    found = known(units * covariance) * units
    torch.testing.assert_close(found, torch.linalg.inv(covariance), rtol=1e-6, atol=1e-6)
    variance = torch.ones(model.count, dtype=torch.float64)
    variance[:2] = torch.tensor([4.0, 0.0])  # what is certain is known much better than what is not
    found = known(torch.diag(variance))
    torch.testing.assert_close(found.diagonal()[[0, 2]], torch.tensor([0.25, 1.0], dtype=torch.float64))
    assert found[1, 1] > 1e6 and (found - torch.diag(found.diagonal())).abs().max() < 1e-6
