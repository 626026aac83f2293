"""The designer for sets and for starts: what it is asked is the variance of an expected error."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch
import yaml

from sidegan.base.typed import build
from sidegan.design.prediction import LACKING, Misfits, Prediction
from sidegan.design.problem import Problem
from sidegan.design.sequence import Search, told
from sidegan.designer import Designer, begin_designed, noise_at, one_by_one, variance_of
from sidegan.designer.plain import PlainDescents
from sidegan.designer.pursuit import Penalties
from sidegan.designer.scene import ArmNumbers
from sidegan.designer.situation import Situation
from sidegan.errors import InfeasibleError
from sidegan.identification import Terms, TorqueModel
from sidegan.identification.model import states_within
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.run import CONF
from sidegan.validity import Constraints, Plane, check

TERMS = Terms(True, True, True, True, False, 0.03)
INTO_THE_DESK = (2.5, 0.0)


@pytest.fixture(scope="module")
def planar_problem(planar):
    return Problem(Constraints(planar, [Plane((0, 0, 1), 0.1)]), Trajectory(2, 3, 8.0), 60)


@pytest.fixture
def random():
    return torch.Generator().manual_seed(0)


@pytest.fixture(scope="module")
def made(planar_problem):
    values = yaml.safe_load((CONF / "worth" / "_base.yaml").read_text(encoding="utf-8"))["misfits"]
    misfits = build(Misfits, values)
    model = TorqueModel(planar_problem.body, TERMS)
    tasks = states_within(planar_problem.constraints.arm, 200, seed=5)
    scale = torch.tensor([20.0, 5.0], dtype=torch.float64)

    def make(**sizes):
        belief = 1e-3 * torch.eye(model.count, dtype=torch.float64)
        return Prediction(model, tasks, scale, replace(misfits, **sizes), belief)

    return make


def test_noise_of_samples_tells_as_much_in_a_second(random):
    information = torch.rand(3, generator=random, dtype=torch.float64) + 0.1
    deviation = torch.tensor(noise_at(50.0, information), dtype=torch.float64)
    torch.testing.assert_close(50 / deviation.square(), information)


def test_the_variance_is_that_of_the_expected_error(planar_problem, made, settings, random):
    """With nothing lacking both rank trajectories alike: logarithms differ by as much between two."""
    prediction, c = made(**dict.fromkeys(LACKING, 0.0)), planar_problem.start(3, random, 0.5)
    prediction.take(told(planar_problem, prediction, c[2:], 60))
    numbers = ArmNumbers(planar_problem.constraints, planar_problem.trajectory)
    scene, descents = numbers.scene(Situation()), PlainDescents(numbers, settings)
    aim = variance_of(prediction, settings.rate)
    descent = descents.descent(scene, aim, Penalties(0.0, 0.0, 0.0, 0.0))
    x = (c[:2].flatten(2).numpy() @ np.linalg.inv(numbers.turn).T) / scene.size
    found = [descent.evaluate(one, np.zeros_like(one))[0] for one in x]
    values = prediction.value(told(planar_problem, prediction, c[:2], settings.samples))
    assert found[0] - found[1] == pytest.approx(float(values[0] - values[1]), rel=1e-6, abs=1e-8)


def test_each_of_a_set_is_designed_given_those_before_it(planar_problem, made, settings):
    prediction = made()
    designer = Designer(planar_problem.constraints, planar_problem.trajectory, settings)
    before, taken = [], []

    def asked():
        before.append(prediction.known.information.clone())
        return variance_of(prediction, settings.rate)

    def take(c):
        taken.append(c)
        prediction.take(told(planar_problem, prediction, c[None], 60))

    c = one_by_one(designer, asked, take, 3, 30)
    assert check(planar_problem.constraints, planar_problem.trajectory, c).valid.all()
    torch.testing.assert_close(torch.stack(taken), c, rtol=0, atol=0)
    more = [torch.linalg.eigvalsh(b - a) for a, b in pairwise(before)]
    assert all(x[0] > -1e-9 * x[-1] and x[-1] > 0 for x in more)


def test_a_set_that_cannot_be_proven_says_why(planar_problem, made, settings):
    family = replace(planar_problem.trajectory, home=INTO_THE_DESK)
    designer, prediction = Designer(planar_problem.constraints, family, settings), made()
    with pytest.raises(InfeasibleError, match="at home"):
        one_by_one(designer, lambda: variance_of(prediction, settings.rate), lambda c: None, 1, 10)


def test_searches_begin_where_the_variance_is_small(planar_problem, made, settings, random):
    prediction, begin = made(), begin_designed(settings, 40)
    c = begin(planar_problem, prediction, 4, random)
    assert c.shape == (4, *planar_problem.trajectory.shape)
    assert len({tuple(one.flatten().tolist()) for one in c}) == 4
    exact = made(**dict.fromkeys(LACKING, 0.0))
    some = exact.value(told(planar_problem, exact, planar_problem.start(40, random, 0.8), 60))
    assert exact.value(told(planar_problem, exact, c, 60)).max() < some.median()


def test_a_search_begins_where_it_is_told_to(planar, planar_problem, made, settings, random):
    """With next to no steps it ends near there; given some, where the whole error is smaller."""
    free, prediction, asked = replace(planar_problem, constraints=Constraints(planar)), made(), []
    first = begin_designed(settings, 40)(free, prediction, 2, random)

    def begin(problem, aim, count, generator):
        asked.append((aim, count))
        return first

    ends = {}
    for steps in (1, 40):
        search = Search(starts=2, rough=1, strict=steps, samples=4, reserve=0.03)
        ends[steps] = search.one(free, prediction, random, begin)
    assert asked == [(prediction, 2)] * 2
    near = (first - ends[1][0]).flatten(1).norm(dim=1).min()
    assert near < 0.2 * first[0].norm() and ends[40][1] < ends[1][1]


def test_where_nothing_is_proven_a_search_begins_anywhere(planar_problem, made, settings, random):
    family = replace(planar_problem.trajectory, home=INTO_THE_DESK)
    nowhere = replace(planar_problem, trajectory=family)
    c = begin_designed(settings, 10)(nowhere, made(), 2, random)
    assert torch.isfinite(c).all() and (c.flatten(1).norm(dim=1) > 0).all()
